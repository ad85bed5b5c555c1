"""Any runs as one page: verdict and worst moment first; then metrics, figures, differences and settings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
from PIL.Image import Image

from cranectl.cases import RunSummary
from cranectl.compare import Agreement, compare_runs, judge
from cranectl.metrics import RunMetrics, run_metrics, workspace_violations
from cranectl.planning import Review
from cranectl.plants import PLANTS
from cranectl.report.page import Figure, Page, Section
from cranectl.report.plan import PlanReport
from cranectl.report.run.differences import DifferenceTables, Logs, LogTables
from cranectl.report.run.figures import DEGREES, Family, RunCurve, distance_figure
from cranectl.report.run.first_screen import agreement_sentence, first_screen_of
from cranectl.report.run.tables import RunTables
from cranectl.report.table import Cell, Table
from cranectl.report.theme import Chart
from cranectl.simulate import Run
from cranectl.support import Array, Quantity

Runs = Mapping[str, Run]  # by label
Pairs = Sequence[tuple[Run, Run]]  # of a plant, and of the reference plant
SMALL_ANGLE = 1e-3  # [°]; smaller differences are given in rad, which takes prefixes
DASHES = ("-", (0, (2, 1)), (0, (1, 1)))  # of plants beside the reference plant


class LogPage:
    """The page of up to four logs, and the captions of its figures."""

    @staticmethod
    @np.errstate(invalid="ignore")  # of a last sample that may hold what stopped its run
    def of(
        logs: Logs,
        remade_by: str,
        notes: Sequence[str] = (),
        *,
        versions: Mapping[str, Mapping[str, str]] | None = None,
        worst: Mapping[str, tuple[float, Image]] | None = None,
    ) -> Page:
        """Return a page of up to four logs; `worst` holds for each time [s] and picture of its worst moment.

        `notes` stand above the table of runs. `versions` are of the software that made each log.
        """
        pairs = {  # each plant's run with that of the reference plant, where both have samples
            label: Agreement.pairs([run for run in log.values() if len(run.time_ns)], log)
            for label, log in logs.items()
        }
        agreements = {label: [judge(*pair) for pair in of_log] for label, of_log in pairs.items()}
        summaries = {
            name: [RunSummary.of(run, Path(name)) for run in log.values()] for name, log in logs.items()
        }
        judged = RunTables.limits(summaries.values())
        follow = any(run.has_reference for log in logs.values() for run in log.values())
        outcome = (RunTables.runs(summaries), judged, RunTables.metrics(summaries) if follow else None)
        settings = [LogTables.settings(logs), LogTables.versions(logs, versions or {})]
        texts = [*notes]
        if len(logs) > 1:
            texts += [LogTables.SAME] if LogTables.what_differs(logs) is None else []
            settings.insert(0, LogTables.what_was_run(logs))  # the first screen of one log has it
        anchor = "run" if len(logs) == 1 else "runs"
        sections = [
            Section(anchor, "Runs and metrics", tuple(texts), tuple(filter(None, outcome))),
            Section("figures", "Figures", figures=_figures(logs, pairs, agreements)),
            *_plans(logs),
            Section("differences", "Differences", tables=_differences(logs, pairs, agreements)),
            Section("settings", "Settings", (), tuple(table for table in settings if table.rows)),
        ]
        shown = tuple(section for section in sections if section.tables or section.figures)
        screen = first_screen_of(logs, summaries, agreements, worst or {})
        return Page(*_title_and_lead(logs), shown, remade_by, screen)

    @staticmethod
    def caption(family: Family, runs: Runs) -> str:
        """Return a sentence with the main number of each run in a figure of this family."""
        if family.name.startswith("trolley"):
            return _outside(runs)
        if family.group == "residual":
            return _farthest_from_prediction(family, runs)
        follow, several, parts = all(run.has_reference for run in runs.values()), len(runs) > 1, []
        shown = runs if follow else {label: run for label, run in runs.items() if run.has("state")}
        if not shown:
            return "The angles of the rope were not measured."
        for what, figure, unit in _CAPTIONS[family.name] if follow else _SWING:
            texts = (_kept(figure(run), unit) + f" ({label})" * several for label, run in shown.items())
            parts.append(f"{what}: {', '.join(texts)}")
        return f"{'; '.join(parts)}."

    @staticmethod
    def agreement(family: Family, pairs: Sequence[tuple[Run, Run]], what: str) -> str:
        """Return the largest difference between the curves of the pairs, after the phrase `what`."""
        largest = max(family.largest_difference(*pair) for pair in pairs)
        unit = family.panels[0].unit
        if unit == "°" and largest < SMALL_ANGLE:
            largest, unit = largest / DEGREES, "rad"
        elif unit == "mm":
            largest, unit = largest / 1e3, "m"
        return f"{what} {_kept(largest, unit)}"


def _title_and_lead(logs: Logs) -> tuple[str, str]:
    """Return what was run as a title, and below it the labels, controllers, drives and plants."""
    runs = [run for log in logs.values() for run in log.values()]
    titles = {run.scenario.name: run.scenario.title or run.scenario.name for run in runs}
    controllers = ", ".join(dict.fromkeys(run.controller for run in runs))
    drives = " and ".join(dict.fromkeys(run.drive for run in runs))
    lead = f"{controllers} with {drives} drives, on {', '.join(PLANTS.in_order(run.plant for run in runs))}"
    title = Cell.listed([*(titles if len(titles) > 1 else titles.values())])
    return title, lead if len(logs) == 1 else f"{', '.join(logs)}: {lead}"


def _plans(logs: Logs) -> list[Section]:
    """Return a section on each plan in minimum time, once for equal references."""
    sections: list[Section] = []
    seen = []
    for label, log in logs.items():
        scenario = next(iter(log.values())).scenario
        reviewed = Review.of(scenario)
        if reviewed and scenario.reference not in seen:
            seen.append(scenario.reference)
            title = "Plan" if len(logs) == 1 else f"Plan, {label}"
            caption = "Bars: when each limit acts. Curves: the use of each limit; at 100 % it allows no more."
            drawn = Figure.drawn(
                "limits and path", caption, PlanReport.figure, reviewed, scenario, alone=True
            )
            tables = tuple(PlanReport.tables(scenario, reviewed))
            sections.append(Section(f"plan-{len(sections)}", title, tables=tables, figures=(drawn,)))
    return sections


def _figures(
    logs: Logs, pairs: Mapping[str, Pairs], agreements: Mapping[str, Sequence[Agreement]]
) -> tuple[Figure, ...]:
    plants = PLANTS.in_order(plant for log in logs.values() for plant in log)
    compared = [pair for of_log in pairs.values() for pair in of_log]
    others = [plant for plant in plants if compared and plant != PLANTS.reference(plants)]
    dashes = dict(zip(others, cycle(DASHES), strict=False))
    curves = [
        RunCurve(label, colour, run, wide=plant in others, dash=dashes.get(plant, "-"))
        for (label, log), colour in zip(logs.items(), Chart.SERIES, strict=False)
        for plant, run in log.items()
        if len(run.time_ns)
    ]
    if not curves:
        return ()
    figures = []
    for family in Family.of([curve.run for curve in curves]):
        drawn = [curve for curve in curves if curve.run.has(family.group)]
        sentence = LogPage.caption(family, {curve.label: curve.run for curve in drawn})
        if compared:
            sentence += f" {LogPage.agreement(family, compared, 'The plants differ by at most')}."
        figures.append(Figure.drawn(family.title, sentence, family.draw, family, drawn))
    if compared:
        labelled = {
            label if len(of_log) == 1 else f"{label}, {pair[0].plant}": pair
            for label, of_log in pairs.items()
            for pair in of_log
        }
        judged = [agreement for of_log in agreements.values() for agreement in of_log]
        limits = {f"{a.drive} drives": a.limit_m for a in judged if a.limit_m is not None}
        title, text = "difference of the plants' loads", agreement_sentence(agreements)
        figures.append(Figure.drawn(title, text, distance_figure, labelled, limits))
    return tuple(figures)


def _differences(
    logs: Logs, pairs: Mapping[str, Pairs], agreements: Mapping[str, Sequence[Agreement]]
) -> tuple[Table, ...]:
    """Compare the plants of each log, folded if they agree, and the first log with every other."""
    tables = []
    for label, of_log in pairs.items():
        for (a, b), judged in zip(of_log, agreements[label], strict=True):
            title = f"{label}: {b.plant} minus {a.plant}"
            tables.append(DifferenceTables.of_signals(title, compare_runs(a, b), folded=bool(judged.passed)))
    (first_label, first), *others = logs.items()
    for label, log in others:
        plants: dict[Table, list[str]] = {}  # plants whose tables are equal share one
        for plant in first:
            if plant in log and len(first[plant].time_ns) and len(log[plant].time_ns):
                table = DifferenceTables.of_signals("", compare_runs(first[plant], log[plant]))
                plants.setdefault(table, []).append(plant)
        for table, names in plants.items():
            tables.append(replace(table, title=f"{', '.join(names)}: {label} minus {first_label}"))
    return tuple(tables)


def _outside(runs: Runs) -> str:
    outside = [
        f"{label} drives the {left.signal.partition('_')[0]} {left.max_excess_m:.3f} m past the end "
        f"of the rig, from {left.first_time_s:.2f} s on"
        for label, run in runs.items()
        for left in workspace_violations(run)
    ]
    return f"{'; '.join(outside).capitalize()}." if outside else "All stay within the rig."


def _farthest_from_prediction(family: Family, runs: Runs) -> str:
    """Return the largest residual of each run in the figure's unit, and when it occurs."""
    unit, texts = family.panels[0].unit, []
    for label, run in runs.items():
        size = np.max([np.abs(panel.values(run)) for panel in family.panels], axis=0)
        texts.append(f"{size.max():.3g} {unit} at {run.time[int(size.argmax())]:.2f} s ({label})")
    return f"Largest difference along one axis: {', '.join(texts)}."


def _measured(run: Run) -> RunMetrics:
    metrics = run_metrics(run)
    assert metrics is not None, "a figure has a sample at least"
    return metrics


_Numbers = tuple[tuple[str, Callable[[Run], float], str], ...]  # of each run: words, number, unit
_FARTHEST: _Numbers = (("Farthest from the reference", lambda run: _measured(run).max_error_m, "m"),)
_LEFT: _Numbers = (("Load off its reference at the end", lambda run: _measured(run).final_error_m, "m"),)
_SWING: _Numbers = (("Largest angle", lambda run: np.abs(run.angles).max() * DEGREES, "°"),)
_CAPTIONS: dict[str, _Numbers] = {  # by family
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
    "relative-path": (("Farthest beside the trolley", lambda run: np.hypot(*_beside(run)).max(), "m"),),
}


def _accelerations(run: Run) -> list[float]:
    return [abs(peak) for peak in _measured(run).peak_acceleration_m_s2]


def _beside(run: Run) -> list[Array]:
    return [panel.values(run) for panel in Family.ALL["relative-path"].panels]


def _kept(value: float, unit: str) -> str:
    """Return a quantity that stays on one line with its unit; below a nanometre it is rounding."""
    text = Quantity(value, unit).text() if unit == "°" else Quantity(value, unit).difference()
    return text.replace(" ", "\N{NO-BREAK SPACE}")
