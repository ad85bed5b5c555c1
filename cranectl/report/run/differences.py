"""Tables of what was run, and of the differences between plants, logs, golden logs and overlays."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isnan
from typing import Any

from cranectl.cases import Pairwise, WorstPair
from cranectl.compare import Comparison, RegressionVerdict
from cranectl.plants import PhysicsStep
from cranectl.report.table import Cell, Table
from cranectl.simulate import Run
from cranectl.support import Quantity, Tree

Logs = Mapping[str, Mapping[str, Run]]  # by label, by plant
MAX_CHARACTERS = 70  # of a value
MAX_ROWS = 12  # of a table that a page does not fold
ASSUMED = " (assumed)"
ASSUMED_NOTE = (
    "Assumed: not stated for this crane, but scaled from the laboratory rig to its rope and rated load."
)


class LogTables:
    """Tables of what was run, with a column for each log."""

    SAME = "Scenario, controller and drives are the same in all logs."

    @staticmethod
    def what_was_run(logs: Logs) -> Table:
        """Return the main facts of each log."""
        first = [next(iter(log.values())) for log in logs.values()]
        facts: dict[str, list[str]] = {
            "scenario": [run.scenario.name for run in first],
            "controller": [run.controller for run in first],
            "drives": [run.drive for run in first],
            "plants": [", ".join(log) for log in logs.values()],
            "duration": [f"{run.scenario.duration:g} s" for run in first],
            "disturbances": [_text(run.scenario.disturbed_by) for run in first],
            "effects": [", ".join(run.scenario.effects.names) or "none" for run in first],
            "physics step": [
                str(PhysicsStep(run.scenario, run.drive)) if run.has_reference else "–" for run in first
            ],
        }
        return _by_log("What was run", logs, facts)

    @staticmethod
    def settings(logs: Logs) -> Table:
        """Return the settings that not all logs leave at the default, with a mark if nobody stated them."""
        first = [next(iter(log.values())) for log in logs.values()]
        changed = [_marked(run) for run in first]
        names = dict.fromkeys(name for settings in changed for name in settings)
        rows = {name: [settings.get(name, "default") for settings in changed] for name in names}
        table = _by_log("Settings that are not the default", logs, rows)
        is_assumed = any(text.endswith(ASSUMED) for texts in rows.values() for text in texts)
        return replace(table, note=ASSUMED_NOTE) if is_assumed else table

    @staticmethod
    def versions(logs: Logs, versions: Mapping[str, Mapping[str, str]]) -> Table:
        """Return the versions of the software that made each log."""
        names = dict.fromkeys(name for of_log in versions.values() for name in of_log)
        rows = {name: [versions.get(label, {}).get(name, "–") for label in logs] for name in names}
        return _by_log("Made with", logs, rows)

    @staticmethod
    def what_differs(logs: Logs) -> Table | None:
        """Return the settings that differ between logs, a column each; None if nothing differs."""
        flat: list[dict[str, Any]] = []
        first = {label: next(iter(log.values())) for label, log in logs.items()}
        is_one_controller = len({run.design.name for run in first.values()}) == 1
        for label, run in first.items():
            requested = _parameters(run) if is_one_controller else {}
            requested |= {"plants": list(logs[label]), "drives": run.drive, "controller": run.controller}
            requested["scenario"] = run.scenario.model_dump(mode="json", exclude={"controller"})
            flat.append(dict(Tree(requested).leaves()))
        rows = {
            name.removeprefix("scenario."): [
                _text(settings[name]) if name in settings else "–" for settings in flat
            ]
            for name in dict.fromkeys(name for settings in flat for name in settings)
            if any(settings.get(name) != flat[0].get(name) for settings in flat)
        }
        return _by_log("What differs", logs, rows) if rows else None


def _marked(run: Run) -> dict[str, str]:
    """Return the changed settings of a run as texts, with a mark at those that nobody stated."""
    assumed = run.scenario.assumed_settings
    stated = run.scenario.controller.parameters.get(run.design.name, {})
    given = {name: value for name, value in _parameters(run).items() if name.rpartition(".")[2] in stated}
    settings = run.scenario.changed_from_default | given
    return {name: f"{_text(value)}{ASSUMED * (name in assumed)}" for name, value in settings.items()}


def _parameters(run: Run) -> dict[str, Any]:
    """Return a controller's parameters by dotted names; those of the flat family are settings in [design]."""
    design = run.design
    return {f"controller.{design.name}.{name}": value for name, value in design.parameters.items()}


def _by_log(title: str, logs: Logs, rows: Mapping[str, Sequence[str]]) -> Table:
    """Return a row for each name; many rows are counted and folded."""
    many = len(rows) > MAX_ROWS
    shown = tuple(Cell.row(name, *texts) for name, texts in rows.items())
    title = f"{title}: {len(rows)}" if many else title
    headings = ("", *(logs if len(logs) > 1 else ("",)))
    return Table(title, headings, shown, labels=1 + len(logs), folded=many)


def _text(value: Any) -> str:
    text = Tree(value).text()
    return text if len(text) <= MAX_CHARACTERS else f"{text[: MAX_CHARACTERS - 1]}…"


class DifferenceTables:
    """Tables of the differences between plants, logs, golden logs and overlays."""

    @staticmethod
    def of_signals(title: str, comparison: Comparison, *, folded: bool = False) -> Table:
        """Return the differences between two runs, one row for each signal."""
        return Table.of(
            title,
            comparison.signals,
            {
                "signal": lambda row: row.signal,
                "max |diff|": lambda row: Quantity(row.max_abs, row.unit).difference(),
                "at [s]": lambda row: _when(row.at_s, row.max_abs),
                "RMS": lambda row: Quantity(row.rms, row.unit).difference(),
                "final": lambda row: Quantity(row.final, row.unit).difference(),
            },
            folded=folded,
        )

    @staticmethod
    def distances(first: str, comparisons: Mapping[str, Comparison]) -> Table:
        """Return the differences of runs, by label, from the run labelled `first`."""
        columns: dict[str, Callable[[tuple[str, Comparison]], Cell | str]] = {
            "": lambda row: row[0],
            "load": lambda row: Quantity(row[1].max_load_error_m, "m").difference(),
            "at [s]": lambda row: _when(row[1].max_load_error_at_s, row[1].max_load_error_m),
            "angles": lambda row: Quantity(row[1].max_angle_error_rad, "rad").difference(),
        }
        return Table.of(f"Largest difference from {first}", comparisons.items(), columns)

    @staticmethod
    def regression(verdict: RegressionVerdict) -> Table:
        """Compare a run with its golden run: one row for each signal, then how both ended."""
        rows = []
        for signal in verdict.signals:
            largest = Quantity(signal.max_abs).si_difference()
            numbers = largest, _when(signal.at_s, signal.max_abs), f"{signal.limit:.1e}"
            rows.append(Cell.row(signal.signal, signal.unit, *numbers, Cell.verdict(signal.passed)))
        difference = Quantity(verdict.end_difference_s).si_difference()
        limit = f"{verdict.end_difference_limit_s:.1e}"
        rows.append(Cell.row("ends", "s", difference, "", limit, Cell.verdict(verdict.ends_passed)))
        before = f"{verdict.status}, was {verdict.golden_status}"
        how = f"both {verdict.status}" if verdict.same_status else before
        rows.append(Cell.row(how, "", "", "", "", Cell.verdict(verdict.same_status)))
        headings = ("signal", "unit", "max |diff|", "at [s]", "limit", "verdict")
        title = f"{verdict.plant}, {verdict.samples} samples: new minus golden"
        return Table(title, headings, tuple(rows), labels=2)

    @staticmethod
    def regressions(outcomes: Mapping[str, Sequence[RegressionVerdict] | str]) -> Table:
        """Compare logs, by path, with their golden logs: the worst signal, or why there is none."""
        rows = []
        for path, verdicts in outcomes.items():
            if isinstance(verdicts, str):
                rows.append(Cell.row(path, "", verdicts, "", "", Cell.verdict(False)))
                continue
            for verdict in verdicts:
                worst = verdict.worst_first[0]
                said = worst.signal if verdict.same_status and verdict.ends_passed else "ends otherwise"
                numbers = Quantity(worst.max_abs).si_difference(), f"{worst.limit:.1e}"
                rows.append(Cell.row(path, verdict.plant, said, *numbers, Cell.verdict(verdict.passed)))
        headings = ("log", "plant", "worst", "max |diff|", "limit", "verdict")
        return Table("New minus golden", headings, tuple(rows), labels=3)

    @staticmethod
    def pairs(pairwise: Pairwise) -> tuple[Table, Table]:
        """Return how far each plant is from each other at most, and what each does by itself."""
        columns: dict[str, Callable[[WorstPair], Cell | str]] = {
            "drives": lambda pair: pair.drive,
            "plants": lambda pair: f"{pair.plant}, {pair.reference}",
            "cases": lambda pair: f"{pair.cases}",
            "load [m]": lambda pair: Quantity(pair.load_m).si_difference(),
            "angle [rad]": lambda pair: Quantity(pair.angle_rad).si_difference(),
            "tension [N]": lambda pair: Quantity(pair.tension_n).si_difference(),
            "load, where": lambda pair: f"{pair.scenario}, {pair.controller}",
            "agree": _answer,
        }
        note = (
            "Step error: how far the load moves when the plant's own steps are a quarter as long, and the "
            "order by which that falls; - where rounding is all there is. Energy drift: of a free swing "
            "of 20 s."
        )
        alone = Table.of(
            "Each plant by itself",
            pairwise.plants,
            {
                "drives": lambda plant: plant.drive,
                "plant": lambda plant: plant.plant,
                "step error\n[m]": lambda plant: Quantity(plant.step_error_m).si_difference(),
                "order": lambda plant: "-" if isnan(plant.order) else f"{plant.order:.1f}",
                "energy drift\n[m g l]": lambda plant: (
                    "-" if isnan(plant.energy_drift) else Quantity(plant.energy_drift).si_difference()
                ),
                "step error, where": lambda plant: f"{plant.scenario}, {plant.controller}",
            },
            labels=2,
            note=note,
        )
        apart = Table.of("Every plant against every other, at most", pairwise.pairs, columns, labels=2)
        return apart, alone


def _when(time: float, largest: float) -> str:
    """Return the time [s] of the largest difference; a dash for rounding, whose time means nothing."""
    return "-" if largest < Quantity.PROCESSOR_ROUNDING else f"{time:.3f}"


def _answer(pair: WorstPair) -> Cell:
    if pair.failed:
        return Cell(f"NO ({pair.failed})", "bad")
    return Cell.answer(None if pair.not_judged == pair.cases else True)
