"""Any runs as one page: what they were, how they ended, every figure with a sentence, every difference."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
from PIL.Image import Image

from cranectl.cases.case import RunSummary
from cranectl.compare.agreement import Agreement, against_reference, judge
from cranectl.compare.runs import compare_runs
from cranectl.metrics import RunMetrics, run_metrics, workspace_violations
from cranectl.planning.review import reviews
from cranectl.plants.registry import in_order, reference_plant
from cranectl.report.page import Figure, Page, Section
from cranectl.report.plan import plan_figure, plan_tables
from cranectl.report.run.differences import SAME, Logs, comparison_table, what_differs, what_was_run
from cranectl.report.run.figures import (
    DEGREES,
    FAMILIES,
    Family,
    RunCurve,
    distance_figure,
    families_of,
    largest_difference,
)
from cranectl.report.run.tables import limits_table, metrics_table, run_table
from cranectl.report.table import Table
from cranectl.report.theme import SERIES
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.units import quantity

Runs = Mapping[str, Run]  # by label
DASHES = ("-", (0, (2, 1)), (0, (1, 1)))  # of plants beside the reference plant


@np.errstate(invalid="ignore")  # of a last sample that may hold what stopped its run
def log_page(
    logs: Logs,
    remade_by: str,
    notes: Sequence[str] = (),
    *,
    versions: Mapping[str, Mapping[str, str]] | None = None,
    worst: Mapping[str, tuple[float, Image]] | None = None,
) -> Page:
    """Return a page of up to four logs, each with the runs of one plant or more; `notes` come first.

    `versions`: by log, of what made it. `worst`: by log, time and picture of its worst moment.
    """
    agreements = {label: judge(a, b) for label, (a, b) in _pairs(logs).items()}
    runs = [run for log in logs.values() for run in log.values()]
    scenarios = dict.fromkeys(run.scenario.name for run in runs)
    title = runs[0].scenario.title if len(scenarios) == 1 else ""
    summaries = {name: [RunSummary.of(run, Path(name)) for run in log.values()] for name, log in logs.items()}
    judged = limits_table([run for log in summaries.values() for run in log])
    differing = what_differs(logs)
    same = (SAME,) if len(logs) > 1 and differing is None else ()
    outcome = (run_table(summaries, _verdicts(agreements)), judged, differing, metrics_table(summaries))
    requested = what_was_run(logs, versions or {})
    sections = [
        Section("runs", "Runs", (*notes, *same), tuple(table for table in outcome if table is not None)),
        Section("asked", "What was run", (), tuple(table for table in requested if table.rows)),
    ]
    sections += _plans(logs)
    moments = []
    for label, (time, picture) in (worst or {}).items():
        name = f"the crane, {label}" if worst and len(worst) > 1 else "the crane"
        end = logs[label][reference_plant(logs[label])].end_s
        text = f"The load is farthest from its reference at {time:g} s of {end:g} s."
        moments.append(Figure.pictured(name, text, picture))
    if moments:
        sections.append(Section("worst", "Worst moment", figures=tuple(moments)))
    sections.append(Section("figures", "Figures", figures=_figures(logs, agreements)))
    if differences := _differences(logs, agreements):
        sections.append(Section("differences", "Differences", tables=differences))
    return Page(", ".join(scenarios), title, tuple(sections), remade_by)


def _plans(logs: Logs) -> list[Section]:
    """Return a section on each plan in minimum time, once for equal references."""
    sections: list[Section] = []
    seen = []
    for label, log in logs.items():
        scenario = next(iter(log.values())).scenario
        reviewed = reviews(scenario)
        if reviewed and scenario.reference not in seen:
            seen.append(scenario.reference)
            title = "Plan" if len(logs) == 1 else f"Plan, {label}"
            caption = "The load's path from above and from a side, and the shares of the limits that it uses."
            drawn = Figure.drawn("path and limits", caption, plan_figure, reviewed, scenario, alone=True)
            tables = tuple(plan_tables(scenario, reviewed))
            sections.append(Section(f"plan-{len(sections)}", title, tables=tables, figures=(drawn,)))
    return sections


def _verdicts(agreements: Mapping[str, Agreement]) -> str:
    """Return sentences on whether the plants of each log agree."""
    sentences = []
    for label, judged in agreements.items():
        limits = judged.limits
        if judged.limit_m is not None and judged.limit_rad is not None:
            limits = f"limits {quantity(judged.limit_m, 'm')} and {quantity(judged.limit_rad, 'rad')}"
        sentences.append(
            f"{label}: plants at most {quantity(judged.max_load_error_m, 'm')} and "
            f"{quantity(judged.max_angle_error_rad, 'rad')} apart, {limits}: {judged.verdict}."
        )
    return " ".join(sentences)


def _pairs(logs: Logs) -> dict[str, tuple[Run, Run]]:
    """Pair each plant's run with that of the reference plant, by the label of the log."""
    pairs_by_label = {}
    for label, log in logs.items():
        pairs = against_reference([run for run in log.values() if len(run.time_ns)], log)
        for pair in pairs:
            pairs_by_label[label if len(pairs) == 1 else f"{label}, {pair[0].plant}"] = pair
    return pairs_by_label


def _figures(logs: Logs, agreements: Mapping[str, Agreement]) -> tuple[Figure, ...]:
    pairs = _pairs(logs)
    plants = in_order(plant for log in logs.values() for plant in log)
    others = [plant for plant in plants if pairs and plant != reference_plant(plants)]
    dashes = dict(zip(others, cycle(DASHES), strict=False))
    curves = [
        RunCurve(label, colour, run, wide=plant in others, dash=dashes.get(plant, "-"))
        for (label, log), colour in zip(logs.items(), SERIES, strict=False)
        for plant, run in log.items()
        if len(run.time_ns)
    ]
    if not curves:
        return ()
    shown = {curve.label: curve.run for curve in curves}
    figures = []
    for family in families_of(curve.run for curve in curves):
        sentence = caption(family, shown)
        if pairs:
            sentence += f" {agreement(family, list(pairs.values()), 'The plants differ by at most')}."
        figures.append(Figure.drawn(family.title, sentence, family.draw, family, curves))
    if pairs:
        title, text = "distance of the plants' loads", _verdicts(agreements)
        judged = agreements.values()
        limits = {
            f"{agreement.drive} drives": agreement.limit_m
            for agreement in judged
            if agreement.limit_m is not None
        }
        figures.append(Figure.drawn(title, text, distance_figure, pairs, limits))
    return tuple(figures)


def _differences(logs: Logs, agreements: Mapping[str, Agreement]) -> tuple[Table, ...]:
    """Compare the plants of each log, folded if they agree, and the first log with every other."""
    tables = [
        comparison_table(
            f"{label}: {b.plant} minus {a.plant}", compare_runs(a, b), folded=bool(agreements[label].passed)
        )
        for label, (a, b) in _pairs(logs).items()
    ]
    (first_label, first), *others = logs.items()
    for label, log in others:
        plants: dict[Table, list[str]] = {}  # those whose tables say the same have one
        for plant in first:
            if plant in log and len(first[plant].time_ns) and len(log[plant].time_ns):
                table = comparison_table("", compare_runs(first[plant], log[plant]))
                plants.setdefault(table, []).append(plant)
        for table, names in plants.items():
            tables.append(replace(table, title=f"{', '.join(names)}: {label} minus {first_label}"))
    return tuple(tables)


def caption(family: Family, runs: Runs) -> str:
    """Tell what `family` shows of these runs, which share a scenario."""
    if family.name.startswith("trolley"):
        return _outside(runs)
    several, parts = len(runs) > 1, []
    for what, figure, unit in _CAPTIONS[family.name]:
        texts = (_kept(figure(run), unit) + f" ({label})" * several for label, run in runs.items())
        parts.append(f"{what}: {', '.join(texts)}")
    return f"{'; '.join(parts)}."


def agreement(family: Family, pairs: Sequence[tuple[Run, Run]], what: str) -> str:
    """Tell by how much the curves of the pairs differ at most, after the phrase `what`."""
    largest = max(largest_difference(family, *pair) for pair in pairs)
    return f"{what} {_kept(largest, family.panels[0].unit)}"


def _outside(runs: Runs) -> str:
    outside = [
        f"{label} drives the {left.signal.partition('_')[0]} {left.max_excess_m:.3f} m past the end "
        f"of the rig, from {left.first_time_s:.2f} s on"
        for label, run in runs.items()
        for left in workspace_violations(run)
    ]
    return f"{'; '.join(outside).capitalize()}." if outside else "All stay within the rig."


def _measured(run: Run) -> RunMetrics:
    metrics = run_metrics(run)
    assert metrics is not None, "a figure has a sample at least"
    return metrics


_FARTHEST = (("Farthest from the reference", lambda run: _measured(run).max_error_m, "m"),)
_LEFT = (("Load off its reference at the end", lambda run: _measured(run).final_error_m, "m"),)
# By the name of a family, what is said of each run: words, the figure, its unit.
_CAPTIONS: dict[str, tuple[tuple[str, Callable[[Run], float], str], ...]] = {
    **dict.fromkeys(("space", "load"), _FARTHEST),
    **dict.fromkeys(("error", "load-path"), _LEFT),
    "linear-input": (("Largest |v|", lambda run: np.abs(run.block("virtual_input")[:, :3]).max(), "m/s⁴"),),
    "input": (
        ("Largest acceleration of bridge or trolley", lambda run: max(_accelerations(run)[:2]), "m/s²"),
        ("of the rope", lambda run: _accelerations(run)[2], "m/s²"),
    ),
    "angles": (
        ("Largest angle", lambda run: max(_measured(run).max_abs_angle_rad) * DEGREES, "°"),
        ("at the end", lambda run: np.abs(run.angles[-1]).max() * DEGREES, "°"),
    ),
    "relative-path": (("Farthest beside the trolley", lambda run: _beside(run).max(), "m"),),
}


def _accelerations(run: Run) -> list[float]:
    return [abs(peak) for peak in _measured(run).peak_acceleration_m_s2]


def _beside(run: Run) -> Array:
    return np.hypot(*(panel.values(run) for panel in FAMILIES["relative-path"].panels))


def _kept(value: float, unit: str) -> str:
    """Return a quantity that stays on one line with its unit."""
    return quantity(value, unit).replace(" ", "\N{NO-BREAK SPACE}")
