"""Printed and computed numbers of the thesis: norms, and Tables 5.1 to 5.4 on two plants."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

from cranectl.design import Design, design_controller
from cranectl.metrics import WorkspaceViolation, workspace_violations
from cranectl.planning import load_scenario
from cranectl.plants import Drive
from cranectl.scenario import DesignSettings, Scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import Plan, Run, simulate_run
from cranectl.support import TOML, Shipped

# The six controllers of the thesis, with its names; cranectl has more.
FEEDBACK = {"pole-placement": "pole placement", "lqr": "LQR"}
ROBUSTIFIERS = {"": "feedback alone", "hinf": "S/KS", "loop-shaping": "loop shaping"}
CONTROLLERS = tuple(f"{feedback}+{r}".rstrip("+") for feedback in FEEDBACK for r in ROBUSTIFIERS)
# Plant and drive of each computed column.
SOURCES: dict[str, tuple[str, Drive]] = {
    "analytic": ("analytic", "ideal"),
    "mujoco": ("mujoco", "ideal"),
    "mujoco_velocity": ("mujoco", "velocity"),
}
JUDGED_SOURCES = ("analytic", "mujoco")  # the thesis simulates ideal drives
SYMBOLS = {  # of columns
    "bridge_acceleration": "ẍ_c",
    "trolley_acceleration": "ÿ_c",
    "rope_acceleration": "l̈",
    "load_x": "z₁",
    "load_y": "z₂",
    "load_z": "z₃",
    "gamma": "γ",
}


@dataclass(frozen=True)
class Number:
    """A printed number and the computed ones."""

    printed: float
    computed: dict[str, float]  # by source
    tolerance: float  # absolute
    explained: bool
    reason: str
    decimals: int | None = None  # printed; if set, computed numbers must have the same printed digits

    @property
    def judged_values(self) -> list[float]:
        """The computed numbers that are judged."""
        return [self.computed[source] for source in JUDGED_SOURCES if source in self.computed]

    @property
    def difference(self) -> float:
        """The largest difference from the printed number, with its sign."""
        return max((value - self.printed for value in self.judged_values), key=abs)

    @property
    def is_within(self) -> bool:
        """Whether all computed numbers are within the tolerance and have the printed digits."""
        digits = self.decimals is None or all(
            agrees_as_printed(v, self.printed, self.decimals) for v in self.judged_values
        )
        return digits and abs(self.difference) <= self.tolerance


Numbers = dict[str, Number]  # by column, of a controller


@dataclass(frozen=True)
class ThesisTable:
    """A table of chapter 5."""

    title: str
    rows: dict[str, Numbers]  # by controller


@dataclass(frozen=True)
class Reproduction:
    """Chapter 5, run again."""

    designs: dict[str, Design]  # by controller, of the last scenario
    tables: dict[str, ThesisTable]  # by number, or "norms"
    departures: tuple[tuple[str, str, WorkspaceViolation], ...]  # scenario, controller, out of the rig

    def numbers(self) -> Iterator[tuple[str, str, str, Number]]:
        """Yield (table, controller, column, number) of all printed numbers."""
        for name, table in self.tables.items():
            for controller, numbers in table.rows.items():
                for column, number in numbers.items():
                    yield name, controller, column, number

    @property
    def gains(self) -> dict[str, list[float]]:
        """State feedback gains by name, which the thesis does not print."""
        return {name: design.gain.tolist() for name, design in self.designs.items() if "+" not in name}

    @property
    def passed(self) -> bool:
        """Whether all computed numbers are within their tolerances."""
        return all(number.is_within for *_, number in self.numbers())

    @property
    def summary(self) -> str:
        """Counts of printed numbers that are explained, within fitted tolerances, or out of tolerance."""
        within = [number.explained for *_, number in self.numbers() if number.is_within]
        outside = sum(not number.is_within for *_, number in self.numbers())
        text = f"{sum(within)} explained, {len(within) - sum(within)} within fitted tolerances"
        return f"{text}, {outside} out of tolerance" if outside else text

    @property
    def open_points(self) -> dict[str, list[str]]:
        """Tables and columns of unexplained numbers, by what is known about them."""
        columns: dict[str, dict[str, None]] = {}
        for name, _, column, number in self.numbers():
            if not number.explained:
                columns.setdefault(number.reason, {})[f"{name} {SYMBOLS[column]}"] = None
        return {reason: list(of_reason) for reason, of_reason in columns.items()}

    @property
    def unnoticed(self) -> list[str]:
        """Sentences on runs that leave the rig, which the thesis did not notice."""
        return [
            f"the thesis did not notice that on {scenario} {controller} drives {left.signal} out of the rig, "
            f"from {left.first_time_s:g} s on, by up to {left.max_excess_m:.3f} m"
            for scenario, controller, left in self.departures
        ]

    def notes(self) -> list[str]:
        """Return notes on gains, unexplained numbers and runs that leave the rig."""
        gains = (
            f"gains of {name} (not printed in the thesis): {', '.join(f'{gain:.5g}' for gain in values)}"
            for name, values in self.gains.items()
        )
        unexplained = (f"unexplained, {', '.join(of)}: {why}" for why, of in self.open_points.items())
        return [*gains, *unexplained, *self.unnoticed]

    def to_json(self) -> dict[str, Any]:
        """Return the reproduction as plain data."""
        tables = {
            name: [_row_json(controller, numbers) for controller, numbers in table.rows.items()]
            for name, table in self.tables.items()
        }
        numbers = [(f"{name} {column}", number) for name, _, column, number in self.numbers()]
        unexplained = {f"{name}: {number.reason}" for name, number in numbers if not number.explained}
        fields = ("signal", "first_time_s", "max_excess_m")
        departures = [
            {"scenario": scenario, "controller": controller} | {name: getattr(left, name) for name in fields}
            for scenario, controller, left in self.departures
        ]
        return {
            "passed": self.passed,
            "gains": self.gains,
            "norms": tables.pop("norms"),
            "tables": tables,
            "unexplained": sorted(unexplained),
            "departures": departures,
        }


def reproduce(
    progress: Callable[[str, float], None] | None = None, watch: Callable[[str, Run], None] | None = None
) -> Reproduction:
    """Run chapter 5 again.

    `progress` is called after each run with its name and simulated time [s]. `watch` is called with source
    and run, by scenario, then by controller, in the order of `SOURCES`.
    """
    printed, tolerances = _read_data("printed.toml"), _read_data("tolerances.toml")
    tables: dict[str, dict[str, Any]] = printed["tables"]
    scenarios = _scenarios(tables)
    norms = {entry["controller"]: entry["gamma"] for entry in printed["norms"]}
    readings: dict[tuple[str, str, str], dict[str, float]] = {}  # by table, controller, source; by column
    designs: dict[str, Design] = {}
    departures = []
    planned = [(scenario, Plan.of(scenario)) for scenario in scenarios]
    for (scenario, plan), controller in product(planned, CONTROLLERS):
        design = design_controller(controller, _settings(scenario, controller, norms))
        designs[controller] = design
        for source, (plant, drive) in SOURCES.items():
            run = simulate_run(scenario, plant=plant, drive=drive, design=design, plan=plan)
            read = (name for name, table in tables.items() if table["scenario"] == scenario.name)
            readings |= {(name, controller, source): _read_columns(run, tables[name]) for name in read}
            if watch is not None:
                watch(source, run)
            if progress is not None:
                progress(f"{scenario.name}, {controller}", scenario.duration)
            if source == "mujoco":
                departures += [(scenario.name, controller, left) for left in workspace_violations(run)]
    reproduced = {"norms": _norms(printed["norms"], tolerances["norms"], scenarios[0].design)}
    for name, table in tables.items():
        rows: dict[str, Numbers] = {controller: {} for controller in table["rows"]}
        for controller, column in product(rows, table["columns"]):
            value = table["rows"][controller][table["columns"].index(column)]
            computed = {source: readings[name, controller, source][column] for source in SOURCES}
            tolerance = tolerances["tables"][name][column]
            rows[controller][column] = _number(value, computed, tolerance, controller)
        reproduced[name] = ThesisTable(f"Table {name}, p. {table['page']}: {table['title']}", rows)
    return Reproduction(designs, reproduced, tuple(departures))


def controller_name(name: str) -> str:
    """Return the name of a controller in the thesis."""
    feedback, _, robustifier = name.partition("+")
    return FEEDBACK[feedback] + (f" + {ROBUSTIFIERS[robustifier]}" if robustifier else "")


def agrees_as_printed(value: float, printed: float, decimals: int) -> bool:
    """Return True if `value`, rounded or truncated to `decimals`, equals the printed number."""
    size, unit = abs(value), 10.0**-decimals
    digits = round(abs(printed) / unit)
    return value * printed >= 0.0 and digits in (math.floor(size / unit), math.floor(size / unit + 0.5))


def total_simulated_seconds() -> float:
    """Return the simulated time of all runs of `reproduce` [s]."""
    seconds = sum(scenario.duration for scenario in _scenarios(_read_data("printed.toml")["tables"]))
    return seconds * len(CONTROLLERS) * len(SOURCES)


def _read_data(name: str) -> dict[str, Any]:
    return TOML.read(Shipped.THESIS_FOLDER / name)


def _scenarios(tables: dict[str, dict[str, Any]]) -> list[Scenario]:
    return [load_scenario(name) for name in dict.fromkeys(table["scenario"] for table in tables.values())]


def _settings(scenario: Scenario, controller: str, norms: dict[str, float]) -> DesignSettings:
    """Return the design settings, for S/KS with the printed norm instead of one near the optimum."""
    settings = scenario.design
    if not controller.endswith("+hinf"):
        return settings
    hinf = settings.hinf.model_copy(update={"gamma": norms[controller]})
    return settings.model_copy(update={"hinf": hinf})


def _read_columns(run: Run, table: dict[str, Any]) -> dict[str, float]:
    """Return the columns of a table from one run: extremes of inputs, and the load at the end.

    An extreme is the maximum if the printed number is positive, else the minimum.
    """
    readings = {}
    for column, value in zip(table["columns"], table["rows"][run.design.name], strict=True):
        group = "load" if column in SignalGroup.LOAD.names else "input"
        rows = (run.time >= table.get("from", {}).get(column, 0.0)) & (run.time <= table["until"])
        signal = run.signal(f"{group}.{column}")[rows]
        extreme = signal.max() if value > 0.0 else signal.min()
        readings[column] = float(signal[-1] if group == "load" else extreme)
    return readings


def _norms(
    printed: list[dict[str, Any]], tolerances: dict[str, Any], settings: DesignSettings
) -> ThesisTable:
    """Return the smallest norms of the designs and those of section 5.2.1."""
    rows = {}
    for entry in printed:
        controller = entry["controller"]
        gamma = design_controller(controller, settings).gamma
        assert gamma is not None
        tolerance = tolerances[controller.partition("+")[2]]
        rows[controller] = {"gamma": _number(entry["gamma"], {"analytic": gamma}, tolerance, controller)}
    return ThesisTable("H∞ norms γ, section 5.2.1", rows)


def _number(printed: float, computed: dict[str, float], column: dict[str, Any], controller: str) -> Number:
    tolerance = column.get("rows", {}).get(controller, column)
    decimals = tolerance.get("decimals")
    allowed = tolerance.get("absolute", tolerance.get("relative", 0.0) * abs(printed))
    if decimals is not None:
        allowed = 10.0**-decimals
    return Number(printed, computed, allowed, tolerance["explained"], tolerance["reason"], decimals)


def _row_json(controller: str, numbers: Numbers) -> dict[str, Any]:
    row: dict[str, Any] = {"controller": controller}
    row["printed"] = {column: number.printed for column, number in numbers.items()}
    for source in next(iter(numbers.values())).computed:
        row[source] = {column: number.computed[source] for column, number in numbers.items()}
    for name in ("difference", "tolerance"):
        row[name] = {column: getattr(number, name) for column, number in numbers.items()}
    return row | {"within": all(number.is_within for number in numbers.values())}
