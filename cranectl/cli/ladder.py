"""`cranectl ladder`."""

import shlex
from inspect import cleandoc
from pathlib import Path

import click

from cranectl.cli import command, exit_codes
from cranectl.cli.controller_options import controller_option
from cranectl.cli.idle import OF_RUNS, print_idle_in_analysis
from cranectl.cli.output import Screen, progress_bar
from cranectl.cli.refused_options import refuse_options
from cranectl.support import FileKind

EVERY = 10  # samples: a dozen runs in one file for viewers
LAST_PREDICTED = "friction"  # level, by default


class LadderCommand(command.Command):
    """A command whose help lists the levels."""

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help, with a line for each level in place of LEVELS."""
        from cranectl.analysis.levels import LEVELS

        levels = "\n".join(f"{level.name:11} {level.adds}" for level in LEVELS)
        self.help = cleandoc(str(self.help)).replace("LEVELS", levels)
        super().format_help_text(ctx, formatter)


@click.command("ladder", cls=LadderCommand)
@command.scenario_argument
@controller_option
@click.option("--top", show_default="the last", metavar="LEVEL", help="The last level of the shipped plants.")
@click.option("--predict", is_flag=True, help="Predict what each effect does, and compare.")
@command.scenario_options
@command.output_option(
    "--out", FileKind.MCAP, "Log that overlays all levels. Default: logs/SCENARIO/CONTROLLER-ladder.mcap"
)
@command.output_option("--report", FileKind.HTML, "HTML page of it.")
@command.json_option
def ladder_command(
    request: command.ScenarioRequest,
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
    from cranectl.cases import Case
    from cranectl.controllers import ALL_CONTROLLERS
    from cranectl.log import Layer, check_recordable, check_writable, write_overlay
    from cranectl.report.rig.tables import ladder_table
    from cranectl.support import provenance

    if predict:
        refuse_options(
            {"--out": out, "--report": report},
            "with --predict, which prints a table",
            allowed="--predict with --json",
            remedy="leave out {}, or --predict",
        )
        return _print_prediction(request, controller, top or LAST_PREDICTED, screen)
    top = top or NAMES[-1]
    loaded = request.load()
    name = controller or loaded.controller.name
    log = out or Case.LOG_DIRECTORY / loaded.name / f"{name}-ladder.mcap"
    check_writable(log)
    check_recordable(loaded, ALL_CONTROLLERS.design(name, loaded), LEVELS[-1].drive)
    results = []
    with progress_bar(simulated_seconds(loaded, top)) as advance:
        for result in evaluate_levels(loaded, name, top=top, progress=advance):
            advance(0.0, f"{loaded.name}, {result.level.name}")
            results.append(result)
    made_by = provenance()
    write_overlay(log, {r.level.name: Layer(r.run.every(EVERY), EVERY, made_by) for r in results})
    screen.print(ladder_table(results))
    added = {result.level.name for result in results}
    unread = [*OF_RUNS, *_other_effects(added)]
    print_idle_in_analysis(screen, loaded, request, [name], with_model=True, unread=unread)
    screen.print(f"log: {log}")
    screen.print(f"view: cranectl log layout ladder view.json --log {shlex.quote(str(log))}")
    if report is not None:
        from cranectl.report.rig.page import ladder_page

        screen.save_page(ladder_page(loaded, name, results, command.command_given()), report)
    screen.write_json(
        {"scenario": loaded.name, "controller": name, "levels": [result.to_json() for result in results]}
    )
    return exit_codes.RUN_STOPPED if any(result.run.status.stopped for result in results) else exit_codes.GOOD


def _print_prediction(
    request: command.ScenarioRequest, controller: str | None, top: str, screen: Screen
) -> int:
    """Predict what each effect does to the load, run it and compare; return the exit code."""
    from cranectl.analysis.budget.error_budget import SENSING, error_budget, simulated_seconds
    from cranectl.report.rig.tables import budget_table

    loaded = request.load()
    with progress_bar(simulated_seconds(loaded, top), f"{loaded.name}, budget") as advance:
        budget = error_budget(loaded, controller, top=top, progress=advance)
    screen.print(budget_table(budget))
    added = {"sensing" if entry.level in SENSING else entry.level for entry in budget.entries}
    unread = [*OF_RUNS, "metrics.*", "obstacles.*", *_other_effects(added)]
    print_idle_in_analysis(screen, loaded, request, [budget.controller], unread=unread)
    screen.write_json(budget.to_json())
    return exit_codes.GOOD if budget.holds else exit_codes.LIMIT_EXCEEDED


def _other_effects(added: set[str]) -> list[str]:
    """Return patterns of the settings of all effects but those `added`."""
    from cranectl.scenario import EFFECTS

    return [f"effects.{name}.*" for name in EFFECTS if name not in added]
