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
    from cranectl.cases import CaseResult, RunSummary
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


def run_notes(results: Sequence["CaseResult"]) -> list[str]:
    """What the tables have no room for: stops and workspace violations, one line for what is the same."""
    where: dict[tuple[str, str], list[str]] = {}
    expected_stops: dict[tuple[str, str], list[float]] = {}
    for result in results:
        for run in result.runs:
            if run.status.stopped and result.as_expected:
                expected_stops.setdefault((run.scenario, run.status.label), []).append(run.end_s)
            for note in _notes(run, result.expected):
                name = f"{run.scenario}, {run.controller}"
                where.setdefault((name, note), []).append(f"{run.plant}/{run.drive}")
    stops = [
        f"{scenario}: {len(times)} runs stop with {status} at {min(times):g} to {max(times):g} s, as expected"
        for (scenario, status), times in expected_stops.items()
    ]
    return [f"{name}: {note} ({', '.join(places)})" for (name, note), places in where.items()] + stops


def _notes(run: "RunSummary", expected: str) -> list[str]:
    notes = []
    if run.status.label != expected:
        notes.append(f"{run.status.label} at {run.end_s:g} s: {run.status.explanation}")
    if run.status.label != expected and expected != "completed":
        notes.append(f"expected to end with {expected}")
    violations = run.metrics.workspace_violations if run.metrics is not None else ()
    return notes + [
        f"{violation.signal} leaves the workspace by up to {violation.max_excess_m:.2f} m"
        for violation in violations
    ]


def agreement_table(agreements: Sequence["Agreement"], passed: Sequence[bool]) -> Table:
    """One row a scenario and controller, its drives side by side; `passed` says so for each agreement."""
    limits = {agreement.drive: (agreement.limit_m, agreement.limit_rad) for agreement in agreements}
    table = _table("Agreement of the plants", ("controller",))
    for drive, (limit_m, limit_rad) in limits.items():
        for what, limit in (("load [m]", limit_m), ("angle [rad]", limit_rad)):
            heading = f"{drive}\n{what}\n< {limit:.0e}"
            table.add_column(escape(heading), justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    rows: dict[tuple[str, str], dict[str, tuple[Agreement, bool]]] = {}
    for agreement, good in zip(agreements, passed, strict=True):
        rows.setdefault((agreement.scenario, agreement.controller), {})[agreement.drive] = (agreement, good)
    last = ""
    for (scenario, controller), drives in rows.items():
        if scenario != last:
            table.add_row(f"[bold]{scenario}[/]")
            last = scenario
        cells = []
        for drive in limits:
            found = drives.get(drive)
            cells += _apart(found[0]) if found else ["-", "-"]
        table.add_row(
            f" {controller}", *cells, PASSED if all(good for _, good in drives.values()) else FAILED
        )
    return table


def _apart(agreement: "Agreement") -> list[str]:
    return [
        f"[bold red]{value:.1e}[/]" if value > limit else f"{value:.1e}"
        for value, limit in (
            (agreement.max_load_error_m, agreement.limit_m),
            (agreement.max_angle_error_rad, agreement.limit_rad),
        )
    ]


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
    table.add_column("what it is", overflow="fold")
    for scenario in scenarios:
        table.add_row(scenario.name, f"{scenario.duration:g} s", scenario.controller, scenario.title)
    return table


def _table(title: str, headings: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    for heading in headings:
        table.add_column(heading, no_wrap=True)
    return table
