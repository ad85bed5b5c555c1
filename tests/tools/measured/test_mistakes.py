"""A matrix of mistakes in maps: each is named, and its remedy, typed into the map, gives the right log.

The cranes are integrated in `pendulum`, which shares nothing with the package.
"""

import re
from functools import cache
from itertools import combinations
from math import degrees
from typing import Any, NamedTuple

import numpy as np
import pytest

from cranectl.scenario.load import RigFile
from cranectl.support.arrays import Array
from cranectl.tools.measured.mapping import MeasuredMap
from cranectl.tools.measured.plausibility import PhysicsVerdict, check_physics
from cranectl.tools.measured.responses import Recording
from tests.tools.measured.crane import COMMANDS as COMMAND_MAPS
from tests.tools.measured.crane import mapping
from tests.tools.measured.pendulum import moves, record

COLUMNS = {
    "bridge_position": "x",
    "trolley_position": "y",
    "rope_length": "l",
    "alpha": "alpha",
    "beta": "beta",
    "bridge_command": "wx",
    "trolley_command": "wy",
    "rope_command": "wl",
}
RIGS = ("lab-rig", "bridge-crane", "harbour-crane")
FACTORS = [factor**power for factor in (10.0, 100.0, 1000.0, degrees(1.0)) for power in (1, -1)]
LATE = 0.05  # [s]
SEED = 2
MAX_UNDECIDABLE = 0.15  # of the matrix


class Cell(NamedTuple):
    """One mistake of the map."""

    signal: str
    mistake: str
    factor: float = 1.0
    other: str = ""  # with which it is exchanged

    @property
    def name(self) -> str:
        return f"{self.signal} {self.mistake} {self.other or self.factor:.4}".strip()


def cells() -> list[Cell]:
    found = [Cell(name, "factor", factor) for name in COLUMNS for factor in FACTORS]
    found += [Cell(name, "sign", -1.0) for name in COLUMNS]
    found += [Cell(name, "late") for name in COLUMNS]
    return found + [Cell(first, "exchanged", other=second) for first, second in combinations(COLUMNS, 2)]


# The right log of another crane has the same signals: `test_undecidable_mistakes_look_like_another_crane`.
UNDECIDABLE = {
    ("lab-rig", "rope_length"),
    *((rig, name) for rig in RIGS[1:] for name in ("rope_length", *tuple(COLUMNS)[5:])),
}  # late signals


@cache
def truth(rig: str) -> dict[str, Array]:
    return record(RigFile.load(rig), moves(RigFile.load(rig), SEED), damping=0.003)


def mistaken_map(cell: Cell) -> MeasuredMap:
    """Return the right map with one mistake in it."""
    keys: dict[str, dict[str, Any]] = {name: dict(keys) for name, keys in COMMAND_MAPS.items()}
    own = keys.setdefault(cell.signal, {})
    if cell.mistake == "factor":
        own["scale"] = cell.factor
    elif cell.mistake == "sign":
        own["sign"] = -1
    elif cell.mistake == "exchanged":
        own["column"] = COLUMNS[cell.other]
        keys.setdefault(cell.other, {})["column"] = COLUMNS[cell.signal]
    return mapping(keys, commands="velocity")


def recorded(table: dict[str, Array], settings: MeasuredMap) -> Recording:
    """Return the signals that an import of the table's columns gives."""
    signals = {}
    for name, signal in settings.signals.declared.items():
        values = np.interp(table["t"] + signal.delay, table["t"], table[str(signal.column)])
        signals[name] = signal.convert(values, settings.units(name)[signal.unit])
    return Recording(signals, float(table["t"][1]), np.ones(len(table["t"]), dtype=np.bool_))


def judge(rig: str, table: dict[str, Array], settings: MeasuredMap) -> PhysicsVerdict:
    return check_physics([recorded(table, settings)], settings, RigFile.load(rig))


def late(table: dict[str, Array], column: str, delay: float) -> dict[str, Array]:
    return {**table, column: np.interp(table["t"] - delay, table["t"], table[column])}


def names_the_mistake(cell: Cell, found: str) -> bool:
    """Return whether a message names this mistake, and no other."""
    expected = {
        "factor": f"{cell.signal} is {max(cell.factor, 1.0 / cell.factor):.4g} times too "
        + ("large" if cell.factor > 1.0 else "small"),
        "sign": rf"{cell.signal} \w+ the wrong way",
        "late": rf"{cell.signal} is 0\.0\d+ s late",
        "exchanged": f"the columns of {cell.signal} and {cell.other} are exchanged",
    }[cell.mistake]
    return re.match(expected, found) is not None


def remedied_map(settings: MeasuredMap, remedy: str) -> MeasuredMap:
    """Return the map after its remedy is typed into it."""
    table = settings.model_dump(by_alias=True, exclude_unset=True)
    signals = table["signals"]
    if match := re.fullmatch(r"exchange the columns of signals\.(\w+) and signals\.(\w+)", remedy):
        first, second = (signals[name] for name in match.groups())
        first["column"], second["column"] = second["column"], first["column"]
    elif match := re.fullmatch(r"write sign = (-?1) in signals\.(\w+)", remedy):
        signals[match[2]]["sign"] = int(match[1])
    else:
        match = re.fullmatch(r"write signals\.(\w+)\.(\w+) = (.+)", remedy)
        assert match is not None, remedy
        value = match[3].strip("'") if match[2] == "unit" else float(match[3])
        signals[match[1]][match[2]] = value
    return MeasuredMap.from_table(table, "the map")


def differences(right: Recording, other: Recording) -> float:
    """Return the largest difference of two logs as a share of each signal's size, without their ends."""
    inner = slice(len(right.trusted) // 50, -len(right.trusted) // 50)
    return max(
        float(np.abs(other.columns[name][inner] - values[inner]).max() / np.abs(values).max())
        for name, values in right.columns.items()
    )


@pytest.mark.parametrize("signal", COLUMNS)
@pytest.mark.parametrize("rig", RIGS)
def test_each_mistake_is_named_and_its_remedy_gives_the_right_log(rig: str, signal: str) -> None:
    right = mapping(COMMAND_MAPS, commands="velocity")
    assert judge(rig, truth(rig), right).contradictions == ()
    for cell in (cell for cell in cells() if cell.signal == signal):
        is_late = cell.mistake == "late"
        table = late(truth(rig), COLUMNS[signal], LATE) if is_late else truth(rig)
        settings = mistaken_map(cell)
        verdict = judge(rig, table, settings)
        if is_late and (rig, signal) in UNDECIDABLE:
            assert verdict.contradictions == (), cell.name
            continue
        assert len(verdict.contradictions) == 1, (cell.name, verdict)
        assert names_the_mistake(cell, verdict.contradictions[0]), (cell.name, verdict)
        remedied = remedied_map(settings, verdict.remedies[0])
        assert judge(rig, table, remedied).contradictions == (), cell.name
        error = differences(recorded(truth(rig), right), recorded(table, remedied))
        assert error < (0.03 if is_late else 1e-3), cell.name


def test_few_mistakes_are_undecidable() -> None:
    assert len(UNDECIDABLE) < MAX_UNDECIDABLE * len(RIGS) * len(cells())


@pytest.mark.parametrize(("rig", "signal"), sorted(UNDECIDABLE))
def test_undecidable_mistakes_look_like_another_crane(rig: str, signal: str) -> None:
    """A late clock looks like dead time in a drive: the one crane's wrong log is the other's right one."""
    parameters = RigFile.load(rig)
    if signal == "rope_length":  # a winch without dead time and a late encoder, or one with dead time
        motion = moves(parameters, SEED, axes=(2,))  # only the load's height changes
        mistaken = late(record(parameters, motion), "l", LATE)
        speeds = motion.speeds.copy()
        speeds[:, 2] = late(mistaken, "wl", LATE)["wl"]
        slow = motion._replace(speeds=speeds)
        other = {**record(parameters, slow), "wl": motion.speeds[:, 2]}
        tolerance = 1e-3
    else:  # a drive with dead time and late commands, or one without and commands that come later
        motion, column = moves(parameters, SEED), COLUMNS[signal]
        axis = ("wx", "wy", "wl").index(column)
        asked = {"t": motion.period * np.arange(len(motion.speeds)), column: motion.speeds[:, axis]}
        speeds = motion.speeds.copy()
        speeds[:, axis] = late(asked, column, LATE)[column]
        other = record(parameters, motion._replace(speeds=speeds))
        mistaken = late({**other, column: asked[column]}, column, LATE)
        tolerance = 1e-12
    for name, values in other.items():
        assert np.allclose(values, mistaken[name], atol=tolerance), name
