"""`cranectl advise`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli import command, exit_codes
from cranectl.cli.completion import complete_controllers
from cranectl.cli.idle import print_idle_in_analysis
from cranectl.cli.output import Screen, progress_bar
from cranectl.support import FileKind

if TYPE_CHECKING:
    from cranectl.analysis.advice import Advice
    from cranectl.report.page import Page


@click.command("advise", cls=command.Command)
@command.scenario_argument
@click.option(
    "--controller",
    "controllers",
    multiple=True,
    metavar="NAME",
    shell_complete=complete_controllers,
    help="Repeatable. Default: the six of the flat family.",
)
@command.scenario_options
@command.output_option(
    "--report",
    FileKind.HTML,
    "HTML page with this, the certificate, the ladder and the error budget of the best controller.",
)
@command.json_option
def advise_command(
    request: command.ScenarioRequest, controllers: tuple[str, ...], report: Path | None, screen: Screen
) -> int:
    """Recommend a controller for SCENARIO, and what to improve first.

    "Guaranteed" means that the certificate (see `cranectl certify`) holds with its required margin at
    every operating point that the scenario visits. "Survived" means that it does not, but the run
    completed. "Cost" is the distance of the load from its place under the same controller in continuous
    time. Limits, sensing and delay are the scenario's, or the defaults. Exit code 1 if no controller is
    guaranteed, 3 if none survives.

    \b
    cranectl advise settled-trajectory
    cranectl advise settled-trajectory --controller lqr+loop-shaping --report rig.html
    cranectl advise fixed-position --set effects.delay.seconds=0.03 --set rig.bridge_time_constant=0.05
    """
    from cranectl.analysis.advice import IMPROVEMENTS, advise
    from cranectl.controllers import ALL_CONTROLLERS
    from cranectl.design import CONTROLLERS
    from cranectl.report.rig.tables import controllers_table, improvements_table, recommendation

    loaded = request.load()
    chosen = [ALL_CONTROLLERS.flat_design(name, loaded).name for name in controllers] or list(CONTROLLERS)
    with progress_bar(len(chosen) + IMPROVEMENTS, loaded.name, done="assessed") as advance:
        advice = advise(loaded, chosen, progress=advance)
    screen.print(controllers_table(advice))
    if advice.best is not None:
        screen.print(improvements_table(advice))
    screen.print_each(recommendation(advice))
    print_idle_in_analysis(screen, loaded, request, chosen, with_model=report is not None)
    if report is not None and advice.best is not None:
        screen.save_page(_report(advice), report)
    screen.write_json(advice.to_json())
    if advice.best is None:
        return exit_codes.RUN_STOPPED
    return exit_codes.GOOD if advice.best.guaranteed else exit_codes.LIMIT_EXCEEDED


def _report(advice: "Advice") -> "Page":
    """Evaluate the fidelity levels with the best controller, budget it, and return a page on all of it."""
    from cranectl.analysis.budget.error_budget import error_budget
    from cranectl.analysis.certificate.certify import make_nominal_loops
    from cranectl.analysis.ladder import evaluate_levels
    from cranectl.design import design_controller
    from cranectl.report.rig.page import rig_page

    best, scenario = advice.best, advice.scenario
    assert best is not None
    point, design = best.certificate.worst.point, design_controller(best.controller, scenario.design)
    nominal_loop = make_nominal_loops(scenario, design, [point])[point.rope_length]
    worst = nominal_loop.inner_loop(scenario, point, "velocity")
    results = list(evaluate_levels(scenario, best.controller))
    budget = error_budget(scenario, best.controller)
    return rig_page(advice, (nominal_loop, worst), results, budget, command.command_given())
