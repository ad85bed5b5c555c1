"""`cranectl advise`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli import exit_codes
from cranectl.cli.options import json_option, scenario_options

if TYPE_CHECKING:
    from rich.table import Table

    from cranectl.analysis.advice import Advice


@click.command("advise")
@click.argument("scenario")
@click.option(
    "--controller", "controllers", multiple=True, metavar="NAME", help="Repeatable. Default: all six."
)
@scenario_options
@click.option(
    "--report",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="HTML page with this, the certificate, the ladder and the error budget of the best controller.",
)
@json_option
def advise_command(
    scenario: str,
    controllers: tuple[str, ...],
    rig: Path | None,
    overrides: tuple[str, ...],
    report: Path | None,
    json_file: str | None,
) -> int:
    """Say which controller to take for the drives and sensors of SCENARIO, and what to improve first.

    Guaranteed: the certificate (see `cranectl certify`) holds at every operating point that the scenario
    visits. Survived: it does not, but the run completed. Cost: distance of the load from where the
    continuous-time ideal of the same controller has it. Limits, sensing and delay are the scenario's, or the
    defaults. Exit code 1 if no controller is guaranteed, 3 if none survives.

    \b
    cranectl advise settled-trajectory
    cranectl advise settled-trajectory --controller lqr+loop-shaping --report rig.html
    cranectl advise fixed-position --set effects.delay.seconds=0.03 --set rig.bridge_time_constant=0.05
    """
    from cranectl.analysis.advice import IMPROVEMENTS, advise
    from cranectl.cli.output import console, progress_bar, write_json
    from cranectl.design import CONTROLLERS, checked_controller
    from cranectl.scenario import load_scenario

    loaded = load_scenario(scenario, rig=rig, overrides=overrides)
    if report is not None:
        from cranectl.report.page import check_place

        check_place(report)
    chosen = [checked_controller(name) for name in controllers] or list(CONTROLLERS)
    with progress_bar(len(chosen) + IMPROVEMENTS, done="assessed") as (advance, describe):
        describe(loaded.name)
        found = advise(loaded, chosen, progress=advance)
    screen = console(json_file)
    screen.print(_controllers(found))
    if found.best is not None:
        screen.print(_improvements(found))
    for line in _words(found):
        screen.print(line, soft_wrap=True, markup=False)
    if report is not None and found.best is not None:
        _write_report(found, report, f"cranectl advise {scenario} --report {report}")
        screen.print(f"report: {report}", soft_wrap=True, markup=False)
    write_json(json_file, found.to_json())
    if found.best is None:
        return exit_codes.RUN_STOPPED
    return exit_codes.GOOD if found.best.guaranteed else exit_codes.LIMIT_EXCEEDED


def _write_report(found: "Advice", report: Path, command: str) -> None:
    """Climb the ladder with the best controller, budget it, and write all of it."""
    from cranectl.analysis.budget.error_budget import error_budget
    from cranectl.analysis.certificate.certify import make_judge
    from cranectl.analysis.certificate.linear_plant import linear_plant
    from cranectl.analysis.certificate.loop import inner_loop_of
    from cranectl.analysis.ladder import climb
    from cranectl.design import design_controller
    from cranectl.report.page import write_page
    from cranectl.report.rig_report import rig_page

    best, scenario = found.best, found.scenario
    assert best is not None
    design = design_controller(best.controller, scenario.design)
    judge = make_judge(scenario, design)
    worst = inner_loop_of(linear_plant(scenario, best.certificate.worst.point, "velocity"), design.gain)
    steps = list(climb(scenario, best.controller))
    budget = error_budget(scenario, best.controller)
    write_page(rig_page(found, judge, worst, steps, budget, command), report)


def _controllers(found: "Advice") -> "Table":
    table = _table(f"{found.scenario.name}: controllers, the best first")
    for heading in ("controller", "grade"):
        table.add_column(heading, no_wrap=True)
    for heading in (
        "least\nmargin",
        "error RMS\n[mm]",
        "error max\n[mm]",
        "cost RMS\n[mm]",
        "cost max\n[mm]",
    ):
        table.add_column(heading.replace("[", r"\["), justify="right", no_wrap=True)
    colours = {"guaranteed": "green", "survived": "yellow", "failed": "bold red"}
    for row in found.assessments:
        grade = row.grade if row.survived else row.status.label
        cells = [f"[{colours[row.grade]}]{grade}[/]", f"{row.least_margin:+.3f}"]
        numbers: list[float | None] = [None] * 4
        if row.metrics is not None and row.cost is not None:
            numbers = [row.metrics.rms_error_m, row.metrics.max_error_m, row.cost.rms, row.cost.max]
        cells += ["-" if number is None else f"{1e3 * number:.3g}" for number in numbers]
        table.add_row(row.controller, *cells)
    return table


def _improvements(found: "Advice") -> "Table":
    assert found.best is not None
    table = _table(f"What would help {found.best.controller}, each alone")
    for heading in ("improve", "change"):
        table.add_column(heading, no_wrap=True)
    for heading in ("cost RMS\n[mm]", "saved", "least\nmargin", "grade"):
        table.add_column(heading.replace("[", r"\["), justify="right", no_wrap=True)
    for row in found.improvements:
        after = row.assessment
        cost = f"{1e3 * after.cost.rms:.3g}" if after.cost else "-"
        saved = f"{100 * row.gain:+.0f} %" if after.survived else "-"
        table.add_row(row.name, row.change, cost, saved, f"{after.least_margin:+.3f}", after.grade)
    return table


def _words(found: "Advice") -> list[str]:
    best = found.best
    if best is None:
        return ["No controller survives: improve drives, delay or sensors, or ask for less."]
    worst = best.certificate.worst.point
    lines = [
        f"Take {best.controller}: {best.grade}, least margin {best.least_margin:+.3f} with the {worst}.",
        f"{len(found.points)} operating points; a statement on linear loops frozen there, not on the motion.",
    ]
    if found.improvements and found.improvements[0].gain > 0.0:
        first = found.improvements[0]
        lines.insert(
            1, f"Improve first: {first.name}, {first.change}; takes {100 * first.gain:.0f} % of the cost."
        )
    return lines


def _table(title: str) -> "Table":
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    return Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
