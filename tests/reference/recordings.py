"""Files of motions, scenarios that read them, and the excess of planned motions over their limits."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.planning import load_scenario
from cranectl.planning.limits import excesses, limits_of
from cranectl.planning.limits import motion as motion_of_crane
from cranectl.planning.problem import series_along
from cranectl.planning.review import curve_of
from cranectl.reference import Trajectory
from cranectl.reference.time_laws import TimeLaw
from cranectl.scenario import Scenario

START = [0.4, 0.5, -0.6]
TO = np.array([1.2, 0.9, -0.9])
SAMPLES = """
kind = "samples"
file = "teach.csv"
columns = {time = "t", x = "X", y = "Y", z = "Z"}
units = {time = "ms", length = "mm"}
"""


def motion(seconds: float = 8.0, rate: float = 50.0, noise: float = 0.0) -> np.ndarray:
    """Return times [s] and load positions [m] (N, 4) of a line from START to TO."""
    time = np.arange(0.0, seconds + 1e-9, 1.0 / rate)
    points = np.array(START) + TimeLaw().progress(time, seconds)[0][:, np.newaxis] * (TO - START)
    return np.column_stack([time, points + np.random.default_rng(0).normal(0.0, noise, points.shape)])


def positions(scenario: Scenario) -> np.ndarray:
    """Return the load's positions (N, 3) at the times of `truth`."""
    return Trajectory.of(scenario.reference).sample(motion(rate=100.0)[:, 0])[:, :3]


def truth() -> np.ndarray:
    return motion(rate=100.0)[:, 1:]


def write_csv(path: Path, rows: np.ndarray, *, header: str = "t,X,Y,Z", comma: str = ".") -> None:
    """Write rows in milliseconds and millimetres."""
    separator = ";" if comma == "," else ","
    lines = [separator.join(f"{1e3 * number:.4f}".replace(".", comma) for number in row) for row in rows]
    path.write_text("\n".join([header.replace(",", separator), *lines, ""]), encoding="utf-8")


def scenario_text(segment: str, start: Sequence[float] = START, name: str = "taken", **settings: Any) -> str:
    """Return the file of a scenario of one segment, which may begin further tables after its keys."""
    first = {"name": name, "duration": 10.0, **settings}
    lines = [f"{key} = {inline(value)}" for key, value in first.items()]
    return "\n".join([*lines, f"[reference]\nstart = {[*start]}\n[[reference.segments]]", segment])


def scenario_of(directory: Path, segment: str, start: Sequence[float] = START, **changes: Any) -> Scenario:
    """Return the planned scenario of one segment."""
    path = directory / "taken.toml"
    path.write_text(scenario_text(segment, start), encoding="utf-8")
    return load_scenario(path, overrides=[f"{name}={value}" for name, value in changes.items()])


def inline(value: Any) -> str:
    """Return a value as TOML writes it within a line; entries of None are left out."""
    if isinstance(value, dict):
        entries = (f"{name}={inline(entry)}" for name, entry in value.items() if entry is not None)
        return f"{{{', '.join(entries)}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(inline, value))}]"
    return json.dumps(value)


def largest_excess(scenario: Scenario, samples: int) -> float:
    """Return the largest excess over any limit at so many samples of each segment, as a share of it."""
    limits, point, worst = limits_of(scenario), np.array(scenario.reference.start), -np.inf
    for segment in scenario.reference.segments:
        curve = curve_of(segment, point)
        series = series_along(*curve[:3], np.linspace(0.0, segment.seconds, samples))
        assert curve.to_load is not None
        moved = motion_of_crane(curve.to_load(series), limits.gravity)
        worst = max(worst, *(float(over.max()) for over in excesses(moved, limits).values()))
        point = Trajectory.end_of(segment, point)
    return worst
