"""`cranectl budget`."""

from pathlib import Path

import click

from cranectl.cli import exit_codes
from cranectl.cli.command import Command, json_option, scenario_options
from cranectl.cli.laws import controller_option


@click.command("budget", cls=Command)
@click.argument("scenario")
@controller_option
@click.option("--top", default="friction", show_default=True, metavar="LEVEL", help="The last level.")
@scenario_options
@json_option
def budget_command(
    scenario: str,
    controller: str | None,
    top: str,
    rig: Path | None,
    overrides: tuple[str, ...],
    json_file: str | None,
) -> int:
    """Predict what each effect does to the load, run it and compare.

    \b
    sampled       control at the control period against control in continuous time
    engine        the physics engine's integrator against the exact equations
    servos        velocity servos that lag and feel the load
    limits        of set-points and forces
    observer      velocities and disturbances from exact positions
    noise         of the encoders
    quantisation  steps of the encoders
    delay         computing and transport
    rope          mass, elasticity
    body          a load that swings under its hook
    wind          drag and gusts
    frame         that gives way
    friction      of axes and joint

    An effect that the scenario has settings for is taken with those, else with the defaults. Exit code 1 if
    a measurement exceeds its bound.

    \b
    cranectl budget settled-trajectory
    cranectl budget fast-diagonal --controller lqr+hinf --set effects.delay.seconds=0.01
    cranectl budget near-slack --controller lqr --top servos --json -
    """
    from cranectl.analysis.budget.error_budget import SENSING, error_budget, simulated_seconds
    from cranectl.cli.idle import OF_RUNS, tell_idle_in_analysis
    from cranectl.cli.output import console, progress_bar, write_json
    from cranectl.planning import load_scenario
    from cranectl.report.rig.tables import budget_table
    from cranectl.scenario.effects import EffectSettings

    loaded = load_scenario(scenario, rig=rig, overrides=overrides)
    with progress_bar(simulated_seconds(loaded, top)) as (advance, describe):
        describe(f"{loaded.name}, budget")
        budget = error_budget(loaded, controller, top=top, progress=advance)
    screen = console(json_file)
    screen.print(budget_table(budget))
    levels = ["sensing" if each.level in SENSING else each.level for each in budget.entries]
    unread = [*OF_RUNS, "metrics.*", "obstacles.*"]
    unread += [f"effects.{each}.*" for each in EffectSettings.model_fields if each not in levels]
    tell_idle_in_analysis(screen, loaded, (scenario, rig, overrides), [budget.controller], unread=unread)
    write_json(json_file, budget.to_json())
    return exit_codes.GOOD if budget.holds else exit_codes.LIMIT_EXCEEDED
