"""Files as measuring systems write them, made from a simulated run whose truth is known."""

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.support.arrays import Array
from cranectl.tools.measured.importing import Imported, import_files
from cranectl.tools.measured.mapping import MeasuredMap

STEP = 5  # control samples of 1 ms between two rows
JOINTS = ("x", "y", "l", "alpha", "beta")
SIGNALS = ("bridge_position", "trolley_position", "rope_length", "alpha", "beta")
UNITS = ("m", "m", "m", "rad", "rad")


@functools.cache
def truth() -> Run:
    """A fast move of all axes with velocity drives, without disturbances."""
    scenario = load_scenario("fast-diagonal").model_copy(update={"disturbances": ()})
    return simulate_run(scenario, plant="mujoco", controller="lqr", drive="velocity")


def columns(step: int = STEP) -> dict[str, Array]:
    """The columns of a file by name: time [s], joints [m, rad], and set-points [m/s]."""
    run = truth()
    joints, setpoints = run.block("state")[::step, 0::2], run.block("input")[::step, 3:]
    named = dict(zip(JOINTS, joints.T, strict=True)) | dict(zip(("wx", "wy", "wl"), setpoints.T, strict=True))
    return {"t": run.time[::step], **named}


def write_csv(path: Path, table: Mapping[str, Array], *, names: bool = True, before: str = "") -> Path:
    """Write columns with a comma between them."""
    lines = [",".join(f"{value:.9g}" for value in row) for row in zip(*table.values(), strict=True)]
    header = [",".join(table)] if names else []
    path.write_text(before + "\n".join([*header, *lines]) + "\n")
    return path


def mapping(signals: Mapping[str, Mapping[str, Any] | None] | None = None, **settings: Any) -> MeasuredMap:
    """The map of `columns`; `signals` replaces keys of signals, and None leaves a signal or a key out."""
    table: dict[str, Any] = {
        name: {"column": column, "unit": unit}
        for name, column, unit in zip(SIGNALS, JOINTS, UNITS, strict=True)
    }
    for name, keys in (signals or {}).items():
        table[name] = {} if keys is None else {**table.get(name, {}), **keys}
    table = {n: {k: v for k, v in keys.items() if v is not None} for n, keys in table.items() if keys}
    settings = {"time": {"column": "t"}, **settings, "signals": table}
    return MeasuredMap.from_table(settings, "the map")


COMMANDS = {
    f"{axis}_command": {"column": column, "unit": "m/s"}
    for axis, column in (("bridge", "wx"), ("trolley", "wy"), ("rope", "wl"))
}


def imported(*files: Path, mapping: MeasuredMap) -> Imported:
    """Import files on the laboratory's rig."""
    return import_files(files, mapping, directory=files[0].parent)


def largest_error(run: Run, *, begins: float = 0.0) -> float:
    """Largest error of the joints [m, rad], at the times of the run after `begins` in the truth [s]."""
    true = truth()
    expected = [np.interp(run.time + begins, true.time, values) for values in true.block("state")[:, 0::2].T]
    return float(np.abs(run.block("state")[:, 0::2] - np.array(expected).T).max())
