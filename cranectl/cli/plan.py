"""`cranectl plan`."""

from pathlib import Path

import click

from cranectl import planning, report, simulate
from cranectl import scenario as scenario_files
from cranectl.cli.command import Command
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.output import Screen
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.support import FileKind, InputError

# Settings of runs, which plans do not read.
UNREAD = (
    "controller.*", "design.*", "initial.*", "disturbances.*", "workspace.*", "control.physics_step",
    "rig.look.frame",
)  # fmt: skip


@click.command("plan", cls=Command)
@ScenarioRequest.argument
@Command.output_option(
    "--plot", None, "Draw path and limits over time (.svg, .pdf, .png).", endings=FileKind.PLOTS
)
@click.option(
    "--bound", is_flag=True, help="Plan with twice the knots too; tell what ever finer ones tend to."
)
@ScenarioRequest.options
@Command.json_option
def plan_command(request: ScenarioRequest, plot: Path | None, bound: bool, screen: Screen) -> int:
    """Plan the motions of SCENARIO and show them, without a run.

    Shows how long each motion lasts, which limits act when, and what is proven. Exit code 1 if a limit
    is not proven. A motion with a duration of its own that `run` would refuse is refused here.

    \b
    cranectl plan fast-diagonal-shortest
    cranectl plan fast-diagonal-shortest --plot plan.svg
    cranectl plan fast-diagonal-shortest --bound
    cranectl plan fast-diagonal-shortest --set planning.share=0.8 --json -
    """
    written, directory = request.read(), scenario_files.ScenarioFile.find(str(request.source)).parent
    ready = planning.plan_motions(written, directory)
    simulate.PlannedReference.of(ready)  # refuses what no run can follow
    reviewed = planning.Review.of(ready)
    least = planning.Review.least_durations(ready, written, directory) if bound and reviewed else ()
    if plot is not None and not reviewed:
        raise InputError(
            f"nothing to draw: all segments of {ready.name} say themselves when the load is where",
            allowed="a scenario with a segment in minimum time",
            remedy="take kind = 'move', or time_law = 'minimum-time' instead of a duration",
        )
    screen.print_each(report.PlanReport.tables(ready, reviewed, least))
    if not reviewed:
        screen.print("nothing is proven: no segment is planned in minimum time")
    effects = [name for name, kind in scenario_files.EFFECTS.items() if kind.is_structural or not kind.adds]
    unread = (*IdleSettings.OF_RUNS, *UNREAD, *(f"effects.{name}.*" for name in effects))
    IdleSettings.print_in_analysis(screen, ready, request, [ready.controller.name], unread=unread)
    if plot is not None:
        screen.save_figure(report.PlanReport.figure(reviewed, ready), plot)
    screen.write_json(report.PlanReport.json(ready, reviewed, least))
    proven = all(review.proof.is_valid for review in reviewed)
    return ExitCode.GOOD if proven else ExitCode.LIMIT_EXCEEDED
