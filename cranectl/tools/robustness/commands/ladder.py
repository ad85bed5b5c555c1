"""`cranectl ladder`."""

import shlex
from inspect import cleandoc
from pathlib import Path

import click

from cranectl import cases, support
from cranectl import log as log_files
from cranectl import scenario as scenario_files
from cranectl.cli.command import Command
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.output import Screen
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.support import FileKind
from cranectl.tools import robustness

EVERY = 10  # samples: a dozen runs in one file for viewers


class LadderCommand(Command):
    """A command whose help lists the levels."""

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help, with a line for each level in place of LEVELS."""
        levels = "\n".join(f"{level.name:11} {level.adds}" for level in robustness.LEVELS)
        self.help = cleandoc(str(self.help)).replace("LEVELS", levels)
        super().format_help_text(ctx, formatter)


@click.command("ladder", cls=LadderCommand)
@ScenarioRequest.argument
@ControllerName.option
@click.option("--top", show_default="the last", metavar="LEVEL", help="The last level of the shipped plants.")
@ScenarioRequest.options
@Command.output_option(
    "--out", FileKind.MCAP, "Log that overlays all levels. Default: logs/SCENARIO/CONTROLLER-ladder.mcap"
)
@Command.output_option("--report", FileKind.HTML, "HTML page of it.")
@Command.json_option
def ladder_command(
    request: ScenarioRequest,
    controller: str | None,
    top: str | None,
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

    \b
    cranectl ladder settled-trajectory
    cranectl ladder settled-trajectory --controller lqr+loop-shaping --top delay
    cranectl ladder fixed-position --set effects.delay.seconds=0.02 --report ladder.html
    """
    top = top or robustness.NAMES[-1]
    loaded = request.load()
    name = controller or loaded.controller.name
    log = out or cases.Case.LOG_DIRECTORY / loaded.name / f"{name}-ladder.mcap"
    FileKind.MCAP.check_place(log, option="--out")
    log_files.check_recordable(loaded, ALL_CONTROLLERS.design(name, loaded), robustness.LEVELS[-1].drive)
    results = []
    with Screen.progress_bar(robustness.simulated_seconds(loaded, top)) as advance:
        for result in robustness.evaluate_levels(loaded, name, top=top, progress=advance):
            advance(0.0, f"{loaded.name}, {result.level.name}")
            results.append(result)
    made_by = support.Provenance.now()
    log_files.Log(
        {r.level.name: log_files.Layer(r.run.every(EVERY), EVERY, made_by) for r in results}
    ).write_overlay(log)
    screen.print(robustness.LadderTables.differences(results))
    added = {result.level.name for result in results}
    unread = [*IdleSettings.OF_RUNS, *_other_effects(added)]
    IdleSettings.print_in_analysis(screen, loaded, request, [name], with_model=True, unread=unread)
    screen.print(f"log: {log}")
    screen.print(f"view: cranectl log layout ladder view.json --log {shlex.quote(str(log))}")
    if report is not None:
        screen.save_page(robustness.ladder_page(loaded, name, results, Command.given()), report)
    screen.write_json(
        {"scenario": loaded.name, "controller": name, "levels": [result.to_json() for result in results]}
    )
    return ExitCode.RUN_STOPPED if any(result.run.status.stopped for result in results) else ExitCode.GOOD


def _other_effects(added: set[str]) -> list[str]:
    """Return patterns of the settings of all effects but those `added`."""
    return [f"effects.{name}.*" for name in scenario_files.EFFECTS if name not in added]
