"""`cranectl ladder`."""

from pathlib import Path

import click

from cranectl.cli import exit_codes
from cranectl.cli.command import Command, json_option, output_option, scenario_options
from cranectl.cli.laws import controller_option
from cranectl.support.files import HTML, MCAP

EVERY = 10  # samples: a dozen runs in one file for viewers


@click.command("ladder", cls=Command)
@click.argument("scenario")
@controller_option
@click.option("--top", default="frame", show_default=True, metavar="LEVEL", help="The last level.")
@scenario_options
@output_option("--out", MCAP, "Log that overlays all levels. Default: logs/SCENARIO/CONTROLLER-ladder.mcap")
@output_option("--report", HTML, "HTML page of it.")
@json_option
def ladder_command(
    scenario: str,
    controller: str | None,
    top: str,
    rig: Path | None,
    overrides: tuple[str, ...],
    out: Path | None,
    report: Path | None,
    json_file: str | None,
) -> int:
    """Measure what each effect of the real rig costs, one by one.

    \b
    continuous  theory: nothing sampled, ideal drives
    sampled     control at the control period, inputs held
    engine      the physics engine in place of the equations
    servos      velocity servos of finite bandwidth that feel the load
    limits      limits of velocity, acceleration and force
    sensing     encoders and an observer in place of the state
    delay       computing and transport
    friction    friction of axes and joint
    rope        a rope that has mass, gives and goes slack
    body        a load that swings under its hook
    wind        drag and gusts
    frame       a frame that gives way

    An effect that the scenario has settings for, in a table under [effects], is added with those.

    \b
    cranectl ladder settled-trajectory
    cranectl ladder settled-trajectory --controller lqr+loop-shaping --top delay
    cranectl ladder fixed-position --set effects.delay.seconds=0.02 --report ladder.html
    """
    from cranectl.analysis.ladder import evaluate_levels, simulated_seconds
    from cranectl.cases.places import LOG_DIRECTORY
    from cranectl.cli.output import console, progress_bar, write_json
    from cranectl.log import check_writable
    from cranectl.log.overlay import Layer, write_overlay
    from cranectl.reference import load_scenario
    from cranectl.report.rig.tables import ladder_table
    from cranectl.support.provenance import provenance

    loaded = load_scenario(scenario, rig=rig, overrides=overrides)
    name = controller or loaded.controller.name
    log = out or LOG_DIRECTORY / loaded.name / f"{name}-ladder.mcap"
    check_writable(log)
    results = []
    with progress_bar(simulated_seconds(loaded, top)) as (advance, describe):
        for result in evaluate_levels(loaded, name, top=top, progress=advance):
            describe(f"{loaded.name}, {result.level.name}")
            results.append(result)
    made_by = provenance()
    write_overlay(log, {r.level.name: Layer(r.run.every(EVERY), EVERY, made_by) for r in results})
    screen = console(json_file)
    screen.print(ladder_table(results))
    screen.print(f"log: {log}")
    screen.print(f"view: cranectl log layout ladder view.json --log {log}")
    if report is not None:
        from cranectl.report.page import write_page
        from cranectl.report.rig.page import ladder_page

        command = f"cranectl ladder {scenario} --controller {name} --top {top}"
        write_page(ladder_page(loaded, name, results, command), report)
        screen.print(f"report: {report}")
    write_json(
        json_file,
        {"scenario": loaded.name, "controller": name, "levels": [result.to_json() for result in results]},
    )
    return exit_codes.RUN_STOPPED if any(result.run.status.stopped for result in results) else exit_codes.GOOD
