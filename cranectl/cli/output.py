"""Tables, progress and JSON."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from cranectl.errors import InputError

if TYPE_CHECKING:
    from cranectl.cases import RunSummary
    from cranectl.compare import Agreement, Comparison
    from cranectl.scenario import Scenario

FILE_WIDTH = 120
PASSED, FAILED = "[green]passed[/]", "[bold red]FAILED[/]"


def console(json_file: str | None) -> Console:
    """Where tables go: standard error when standard output carries JSON."""
    screen = Console(stderr=json_file == "-", highlight=False)
    if not screen.is_terminal:  # into a file or a CI log: as wide as the tables are
        screen.width = FILE_WIDTH
    return screen


def write_json(json_file: str | None, data: dict[str, Any]) -> None:
    """Write `data` to a file or, for `-`, to standard output."""
    if json_file is None:
        return
    text = json.dumps(_finite(data), indent=2, ensure_ascii=False)
    if json_file == "-":
        print(text)
        return
    try:
        Path(json_file).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"cannot write {json_file}: {error}", remedy="choose another place with --json"
        ) from None


def _finite(data: Any) -> Any:
    """`data` with infinities and NaN, which JSON does not have, as null."""
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


@contextmanager
def progress_bar(total: float) -> Iterator[tuple[Callable[[float], None], Callable[[str], None]]]:
    """A bar on standard error, over simulated seconds; yields (advance, describe). Silent if no terminal."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} s simulated"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("preparing", total=total)
        yield (
            lambda amount: progress.advance(task, amount),
            lambda text: progress.update(task, description=text),
        )


def run_table(runs: Sequence["RunSummary"]) -> Table:
    """One row a run, grouped by scenario."""
    drives = ", ".join(dict.fromkeys(run.drive for run in runs))
    table = _table(f"Runs, {drives} drives", ("controller", "plant", "status"))
    for heading in ("max\nerror\n[m]", "final\nerror\n[m]", "peak\nẍ_c ÿ_c l̈\n[m/s²]"):
        table.add_column(escape(heading), justify="right", no_wrap=True)
    scenario = ""
    for run in runs:
        if run.scenario != scenario:
            table.add_row(f"[bold]{run.scenario}[/]")
            scenario = run.scenario
        status = f"[bold red]{run.status.label}[/]" if run.status.stopped else run.status.label
        table.add_row(f"  {run.controller}", run.plant, status, *_metric_cells(run))
    return table


def _metric_cells(run: "RunSummary") -> list[str]:
    metrics = run.metrics
    if metrics is None:
        return ["-"] * 3
    extremes = zip(metrics.max_acceleration_m_s2, metrics.min_acceleration_m_s2, strict=True)
    peaks = " ".join(f"{max(pair, key=abs):.3f}" for pair in extremes)
    return [f"{metrics.max_error_m:.4f}", f"{metrics.final_error_m:.4f}", peaks]


def run_notes(runs: Sequence["RunSummary"]) -> list[str]:
    """What the table has no room for: stops and workspace violations."""
    notes = []
    for run in runs:
        name = f"{run.scenario}, {run.controller}, {run.plant}"
        if run.status.stopped:
            notes.append(f"{name}: stopped at {run.end_s:g} s: {run.status.explanation}")
        violations = run.metrics.workspace_violations if run.metrics is not None else ()
        notes += [
            f"{name}: {violation.signal} leaves the workspace at {violation.first_time_s:g} s, "
            f"by up to {violation.max_excess_m:.3g} m"
            for violation in violations
        ]
    return notes


def agreement_table(agreements: Sequence["Agreement"]) -> Table:
    """One row a pair of plants, grouped by scenario."""
    table = _table("Agreement of the plants", ("controller", "drive"))
    for heading in ("load [m]", "limit", "angle [rad]", "limit"):
        table.add_column(escape(heading), justify="right", no_wrap=True)
    table.add_column("verdict")
    scenario = ""
    for agreement in agreements:
        if agreement.scenario != scenario:
            table.add_row(f"[bold]{agreement.scenario}[/]")
            scenario = agreement.scenario
        judged = agreement.limit_m is not None
        table.add_row(
            f"  {agreement.controller}",
            agreement.drive,
            f"{agreement.max_load_error_m:.1e}",
            f"{agreement.limit_m:.0e}" if judged else "-",
            f"{agreement.max_angle_error_rad:.1e}",
            f"{agreement.limit_rad:.0e}" if judged else "-",
            (PASSED if judged else "reported") if agreement.passed else FAILED,
        )
    return table


def comparison_table(comparison: "Comparison") -> Table:
    """One row a signal."""
    table = _table(f"{comparison.b} minus {comparison.a}", ("signal", "unit"))
    for heading in ("max |diff|", "at [s]", "RMS", "final"):
        table.add_column(escape(heading), justify="right", no_wrap=True)
    for row in comparison.signals:
        table.add_row(
            row.signal,
            row.unit,
            f"{row.max_abs:.1e}",
            f"{row.at_s:.3f}",
            f"{row.rms:.1e}",
            f"{row.final:+.1e}",
        )
    return table


def scenario_table(scenarios: Sequence["Scenario"]) -> Table:
    """One row a scenario."""
    table = _table("Scenarios", ("name", "duration", "controller"))
    table.add_column("what it is")
    for scenario in scenarios:
        table.add_row(scenario.name, f"{scenario.duration:g} s", scenario.controller, scenario.title)
    return table


def _table(title: str, headings: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    for heading in headings:
        table.add_column(heading, no_wrap=True)
    return table
