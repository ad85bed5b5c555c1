"""`cranectl ladder`."""

import shlex
from inspect import cleandoc
from pathlib import Path

import click

from cranectl.cli import exit_codes
from cranectl.cli.command import (
    Command,
    ScenarioRequest,
    command_given,
    json_option,
    output_option,
    scenario_argument,
    scenario_options,
)
from cranectl.cli.controller_options import controller_option
from cranectl.cli.idle import OF_RUNS, print_idle_in_analysis
from cranectl.cli.output import Screen, progress_bar
from cranectl.support.errors import InputError
from cranectl.support.files import HTML, MCAP

EVERY = 10  # samples: a dozen runs in one file for viewers


class LadderCommand(Command):
    """A command whose help lists the levels."""

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help, with a line for each level in place of LEVELS."""
        from cranectl.analysis.levels import LEVELS

        levels = "\n".join(f"{level.name:11} {level.adds}" for level in LEVELS)
        self.help = cleandoc(str(self.help)).replace("LEVELS", levels)
        super().format_help_text(ctx, formatter)


@click.command("ladder", cls=LadderCommand)
@scenario_argument
@controller_option
@click.option("--top", show_default="the last", metavar="LEVEL", help="The last level of the shipped plants.")
@click.option("--predict", is_flag=True, help="Predict what each effect does, and compare.")
@scenario_options
@output_option("--out", MCAP, "Log that overlays all levels. Default: logs/SCENARIO/CONTROLLER-ladder.mcap")
@output_option("--report", HTML, "HTML page of it.")
@json_option
def ladder_command(
    request: ScenarioRequest,
    controller: str | None,
    top: str | None,
    predict: bool,
    out: Path | None,
    report: Path | None,
    screen: Screen,
) -> int:
    """Measure what each effect of the real rig costs, one by one.

    \b
    LEVELS

    An effect with settings in the scenario, in a table under [effects], is added with those.

    If the rig names a model, as in `--set rig.model=mine.xml`, that is the last level. It has those effects
    that the model honours.

    With --predict the error budget is printed: what each effect must do to the load, and what it does in
    a run. Its levels begin with `sampled`, control at the control period against control in continuous
    time, and `engine`, the integrator of the physics engine against the exact equations. The last one is
    `friction`, unless --top says otherwise. Exit code 1 if a measurement exceeds its bound.

    \b
    cranectl ladder settled-trajectory
    cranectl ladder settled-trajectory --controller lqr+loop-shaping --top delay
    cranectl ladder fixed-position --set effects.delay.seconds=0.02 --report ladder.html
    cranectl ladder fast-diagonal --controller lqr+hinf --predict
    """
    from cranectl.analysis.ladder import evaluate_levels, simulated_seconds
    from cranectl.analysis.levels import LEVELS, NAMES
    from cranectl.cases.case import LOG_DIRECTORY
    from cranectl.controllers.registry import controller_design
    from cranectl.log.header import check_recordable
    from cranectl.log.overlay import Layer, write_overlay
    from cranectl.log.writer import check_writable
    from cranectl.report.rig.tables import ladder_table
    from cranectl.scenario.effects import EffectSettings
    from cranectl.support.provenance import provenance

    if predict:
        from cranectl.cli.effect_prediction import LAST_LEVEL, print_prediction

        _refuse_files(out, report)
        return print_prediction(request, controller, top or LAST_LEVEL, screen)
    top = top or NAMES[-1]
    loaded = request.load()
    name = controller or loaded.controller.name
    log = out or LOG_DIRECTORY / loaded.name / f"{name}-ladder.mcap"
    check_writable(log)
    check_recordable(loaded, controller_design(name, loaded), LEVELS[-1].drive)
    results = []
    with progress_bar(simulated_seconds(loaded, top)) as advance:
        for result in evaluate_levels(loaded, name, top=top, progress=advance):
            advance(0.0, f"{loaded.name}, {result.level.name}")
            results.append(result)
    made_by = provenance()
    write_overlay(log, {r.level.name: Layer(r.run.every(EVERY), EVERY, made_by) for r in results})
    screen.print(ladder_table(results))
    added = [result.level.name for result in results]
    unread = [
        *OF_RUNS,
        *(
            f"effects.{model_field}.*"
            for model_field in EffectSettings.model_fields
            if model_field not in added
        ),
    ]
    print_idle_in_analysis(screen, loaded, request, [name], with_model=True, unread=unread)
    screen.print(f"log: {log}")
    screen.print(f"view: cranectl log layout ladder view.json --log {shlex.quote(str(log))}")
    if report is not None:
        from cranectl.report.page import write_page
        from cranectl.report.rig.page import ladder_page

        write_page(ladder_page(loaded, name, results, command_given()), report)
        screen.print(f"report: {report}")
    screen.write_json(
        {"scenario": loaded.name, "controller": name, "levels": [result.to_json() for result in results]}
    )
    return exit_codes.RUN_STOPPED if any(result.run.status.stopped for result in results) else exit_codes.GOOD


def _refuse_files(out: Path | None, report: Path | None) -> None:
    """Raise InputError for options of files that a prediction does not write."""
    given = [name for name, value in (("--out", out), ("--report", report)) if value is not None]
    if given:
        raise InputError(
            f"{' and '.join(given)} with --predict, which prints a table",
            allowed="--predict with --json",
            remedy=f"leave out {' and '.join(given)}, or --predict",
        )
