"""Tables, progress and JSON."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich import box
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from cranectl.cli.screen import Screen, heading, progress, styled
from cranectl.support.files import write_text, writing
from cranectl.support.text import printable
from cranectl.support.trees import mapped

if TYPE_CHECKING:
    from cranectl.cases import CaseResult, RunSummary
    from cranectl.compare import Agreement, Comparison
    from cranectl.design import Design
    from cranectl.log import LogDescription
    from cranectl.scenario import Scenario
    from cranectl.simulate import Run

PASSED, FAILED = styled("passed", "green"), styled("FAILED", "bold red")


def console(json_file: str | None) -> Screen:
    """Where tables go: standard error when standard output carries JSON."""
    return Screen(stderr=json_file == "-")


def write_json(json_file: str | None, data: dict[str, Any]) -> None:
    """Write `data` to a file or, for `-`, to standard output."""
    if json_file is None:
        return
    text = json.dumps(mapped(data, _finite), indent=2)
    if json_file == "-":
        print(text)
        return
    with writing(Path(json_file), remedy="choose another place with --json"):
        write_text(Path(json_file), text + "\n")


def _finite(value: Any) -> Any:
    """`value`, null in place of infinities and NaN, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def progress_bar(
    total: float, *, done: str = "simulated"
) -> Iterator[tuple[Callable[[float], None], Callable[[str], None]]]:
    """A bar on standard error, over simulated seconds; yields (advance, describe). Silent if no terminal."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} s {done}"),
        TimeRemainingColumn(),
    )
    with progress(*columns) as shown:
        task = shown.add_task("preparing", total=total)
        yield (
            lambda amount: shown.advance(task, amount),
            lambda text: shown.update(task, description=printable(text)),
        )


def run_table(runs: Sequence["RunSummary"]) -> Table:
    """One row a run, grouped by scenario."""
    drives = ", ".join(dict.fromkeys(run.drive for run in runs))
    table = _table(f"Runs, {drives} drives", ("controller", "plant", "status"))
    for name in ("max\nerror\n[m]", "final\nerror\n[m]", "peak\nẍ_c ÿ_c l̈\n[m/s²]"):
        table.add_column(heading(name), justify="right", no_wrap=True)
    scenario = ""
    for run in runs:
        if run.scenario != scenario:
            table.add_row(styled(run.scenario, "bold"))
            scenario = run.scenario
        status = styled(run.status.label, "bold red" if run.status.stopped else "")
        table.add_row(f"  {run.controller}", run.plant, status, *_metric_cells(run))
    return table


def _metric_cells(run: "RunSummary") -> list[str]:
    from cranectl.metrics import peak_acceleration

    metrics = run.metrics
    if metrics is None:
        return ["-"] * 3
    peaks = " ".join(f"{value:.3f}" for value in peak_acceleration(metrics))
    return [f"{metrics.max_error_m:.4f}", f"{metrics.final_error_m:.4f}", peaks]


def run_notes(results: Sequence["CaseResult"]) -> list[str]:
    """What the tables have no room for: stops, workspace violations, long steps; a line each."""
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
    steps = [
        f"{found.scenario}, {found.controller}: the steps are too long for the plants to agree; with "
        f"control.physics_step = {found.curing_step_s:g} they do"
        for found in (result.agreement for result in results)
        if found is not None and found.curing_step_s is not None
    ]
    return [f"{name}: {note} ({', '.join(places)})" for (name, note), places in where.items()] + stops + steps


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


def comparison_table(comparison: "Comparison") -> Table:
    """One row a signal."""
    table = _table(f"{comparison.b} minus {comparison.a}", ("signal", "unit"))
    for name in ("max |diff|", "at [s]", "RMS", "final"):
        table.add_column(name, justify="right", no_wrap=True)
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


def design_tables(design: "Design") -> list[Table]:
    """Figures of a design, and its poles."""
    margins, figures = design.margins, _table(f"{design.name}, one axis", ("", "", ""))
    figures.show_header = False
    rows = [
        ("gain k0 … k3", "  ".join(f"{gain:.6g}" for gain in design.gain), "on e and three derivatives"),
        *_gamma_rows(design),
        ("gain margin", f"{margins.gain_margin:.3f}", "factor on the loop gain that destabilises"),
        ("phase margin", f"{math.degrees(margins.phase_margin):.1f}°", "at the crossover"),
        ("disk margin", f"{margins.disk_margin:.3f}", "balanced S - T: gain and phase together"),
        ("modulus margin", f"{margins.modulus_margin:.3f}", "distance of the loop from -1"),
        ("peak of S", f"{margins.sensitivity_peak:.3f}", ""),
        ("peak of T", f"{margins.complementary_peak:.3f}", ""),
        ("crossover", f"{margins.crossover:.2f} rad/s", "loop gain 1"),
        ("bandwidth", f"{margins.bandwidth:.2f} rad/s", "T 3 dB below 1"),
    ]
    for row in rows:
        figures.add_row(*row)
    poles = _table("Poles [1/s]", ("closed loop", "robustifier"))
    columns = [sorted(design.closed_loop_poles.tolist(), key=_pole_order)]
    columns.append(sorted(np.linalg.eigvals(design.robustifier.a).tolist(), key=_pole_order))
    for pair in zip_longest(*([_pole_text(pole) for pole in column] for column in columns), fillvalue=""):
        poles.add_row(*pair)
    return [figures, poles]


def _gamma_rows(design: "Design") -> list[tuple[str, str, str]]:
    if design.gamma is None or design.gamma_achieved is None:
        return []
    shaping = design.stability_margin is not None
    what = "coprime factors of the shaped loop" if shaping else "of [W_s S; W_ks K S]"
    rows = [("gamma", f"{design.gamma:.5f}", f"smallest possible, {what}")]
    rows.append(("gamma achieved", f"{design.gamma_achieved:.5f}", "by this robustifier"))
    if design.stability_margin is not None:
        rows.append(("stability margin", f"{design.stability_margin:.5f}", "1 / gamma achieved"))
    return rows


def _pole_order(pole: complex) -> tuple[float, float]:
    return (-complex(pole).real, complex(pole).imag)


def _pole_text(pole: complex) -> str:
    pole = complex(pole)
    return f"{pole.real:.4g}" + (f" {pole.imag:+.4g}i" if pole.imag else "")


def info_lines(
    description: "LogDescription",
    runs: Sequence["Run"],
    agreement: "Agreement | None",
    software: Sequence[str],
) -> list[str]:
    """What a log is, a line a fact; `software` is what differs from what is installed."""
    scenario, design = runs[0].scenario, runs[0].design
    defaults = type(scenario.rig)().model_dump()
    changed = {name: value for name, value in scenario.rig.model_dump().items() if value != defaults[name]}
    facts = [
        ("file", description.path),
        ("scenario", f"{scenario.name}: {scenario.title}" if scenario.title else scenario.name),
        ("design", f"{design.name}, {runs[0].drive} drives"),
    ]
    facts += [
        (run.plant, f"{run.status.label} at {run.end_ns / 1e9:g} s, {len(run.time_ns)} samples")
        for run in runs
    ]
    facts += [
        ("rig", ", ".join(f"{name} = {value}" for name, value in changed.items()) or "default parameters"),
        ("effects", ", ".join(scenario.effects.names) or "none"),
        ("sampling", f"{scenario.control.period:g} s, one sample of {description.every} logged"),
    ]
    if agreement is not None:
        apart = f"{agreement.max_load_error_m:.1e} m, {agreement.max_angle_error_rad:.1e} rad"
        facts.append(("verdict", f"plants at most {apart} apart: {_verdict_text(agreement)}"))
    size = f"{description.size_bytes / 1e6:.1f} MB, {description.messages} messages"
    facts += [
        ("versions", ", ".join(f"{name} {version}" for name, version in description.versions.items())),
        *(("differs", difference) for difference in software),
        ("attachments", ", ".join(description.attachments)),
        ("integrity", f"format {description.format}, {size}; checksums and counts are right"),
    ]
    return [f"{name:12} {text}" for name, text in facts]


def _verdict_text(agreement: "Agreement") -> str:
    if agreement.passed is None:
        return f"not judged: {agreement.limits}"
    return agreement.verdict


def topic_table(description: "LogDescription") -> Table:
    """One row a topic."""
    table = _table("Topics", ("topic", "message"))
    for name in ("messages", "rate [Hz]"):
        table.add_column(name, justify="right", no_wrap=True)
    for topic in description.topics:
        rate = f"{topic.rate_hz:g}" if topic.rate_hz is not None else "-"
        table.add_row(topic.topic, topic.schema, str(topic.messages), rate)
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
    for name in headings:
        table.add_column(name, no_wrap=True)
    return table
