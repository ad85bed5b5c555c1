"""Make a run from signals at even times: the load, rates, and what is known of the crane.

The run has the plant `measured`. Rates are slopes of cubics that are fitted to RATE_SPAN seconds of samples.
"""

import hashlib
from collections.abc import Mapping, Sequence
from math import ceil, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from cranectl.design import ControllerDesign
from cranectl.plants import PLANTS, Drive, PlantEntry
from cranectl.scenario import NANOSECONDS, MeasuredScenario, RigParameters, Scenario, longest_step
from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import Array
from cranectl.tools.measured.mapping import ANGLES, LOAD, POSITIONS, MeasuredMap

MEASURED = PlantEntry(
    name="measured", label="measured", colour="series-4", where="", batch=0, by_default=False
)
UNKNOWN_CONTROLLER = "unknown-controller"  # a log of a crane does not have it
LAB_STEP = 0.001  # [s] of physics on the laboratory rig
RATE_SPAN = 0.1  # [s] of samples from which a rate is computed
RATE_ORDER = 3  # of the polynomials whose slopes are the rates
MIN_RATE_SAMPLES = 5
MAX_RATE_SAMPLES = 2001  # of a cubic; of more, the means of neighbours are taken, or it would take minutes
RATES = dict(zip(SignalGroup.STATE.names[::2], SignalGroup.STATE.names[1::2], strict=True)) | {
    name: f"{name}_dot" for name in LOAD
}
DRIVES: dict[str | None, Drive] = {
    None: "ideal",
    "acceleration": "ideal",
    "velocity": "velocity",
    "force": "force",
}


def assemble_run(
    signals: Mapping[str, Array], mapping: MeasuredMap, rig: RigParameters, period_ns: int
) -> Run:
    """Return the run that an import of a file with `signals` gives, each (N,) in SI units at even times."""
    time_ns = period_ns * np.arange(len(next(iter(signals.values()))), dtype=np.int64)
    table, columns, groups = empty_table(mapping, len(time_ns))
    for name, values in signals.items():
        columns[name][:] = values
    complete(columns, mapping, period_ns / NANOSECONDS)
    return make_run(table, groups, time_ns, mapping=mapping, rig=rig, description="known signals")


def empty_table(mapping: MeasuredMap, rows: int) -> tuple[Array, dict[str, Array], tuple[SignalGroup, ...]]:
    """Return a table for all signals of the run, its columns (views) by name, and their groups."""
    declared = mapping.signals.declared
    has_angles, has_load = ANGLES[0] in declared, LOAD[0] in declared
    groups = SignalGroup.measured(mapping.commands or "", angles=has_angles, load=has_angles or has_load)
    names = [name for group in groups for name in group.names]
    table = np.empty((rows, len(names)), order="F")  # signals are computed one after the other
    return table, dict(zip(names, table.T, strict=True)), groups


def complete(columns: Mapping[str, Array], mapping: MeasuredMap, period: float) -> None:
    """Compute the load from the joints, unless it was measured, and the rates of all positions."""
    declared = mapping.signals.declared
    if ANGLES[0] in declared and LOAD[0] not in declared:
        _put_load(columns)
    for name, rate in RATES.items():
        if name in columns:
            columns[rate][:] = _slopes(columns[name], period)


def rate_samples(period: float) -> int:
    """Return the odd number of samples to which a cubic is fitted for a slope."""
    return max(MIN_RATE_SAMPLES, round(RATE_SPAN / period)) // 2 * 2 + 1


def _slopes(values: Array, period: float) -> Array:
    """Return the rate of a signal (N,) as the slope of cubics fitted around each sample."""
    samples = rate_samples(period)
    if MAX_RATE_SAMPLES < samples <= len(values):
        share = ceil(samples / MAX_RATE_SAMPLES)
        means = values[: len(values) // share * share].reshape(-1, share).mean(axis=1)
        middle = share * np.arange(len(means)) + 0.5 * (share - 1)
        interpolated: Array = np.interp(np.arange(len(values)), middle, _slopes(means, share * period))
        return interpolated
    slopes: Array = (
        np.gradient(values, period)
        if len(values) < samples
        else savgol_filter(values, samples, polyorder=RATE_ORDER, deriv=1, delta=period)
    )
    return slopes


def make_run(
    table: Array,
    groups: tuple[SignalGroup, ...],
    time_ns: NDArray[np.int64],
    *,
    mapping: MeasuredMap,
    rig: RigParameters,
    description: str,
) -> Run:
    """Return the run with this table of signals at even times."""
    PLANTS.remember(MEASURED)
    return Run(
        scenario=_scenario(mapping, rig, time_ns, table),
        design=ControllerDesign(UNKNOWN_CONTROLLER),
        plant=MEASURED.name,
        drive=DRIVES[mapping.commands],
        model=description,
        time_ns=time_ns,
        table=table,
        reference=np.zeros((len(time_ns), 0)),
        status=RunStatus.COMPLETED,
        end_ns=int(time_ns[-1]),
        own_groups=groups,
    )


def load_of(joints: Array) -> Array:
    """Return positions of the load (N, 3) [m] from bridge, trolley, rope, alpha and beta (N, 5)."""
    x, y, rope, alpha, beta = joints.T
    lateral = rope * np.cos(beta)
    return np.column_stack([x + rope * np.sin(beta), y + lateral * np.sin(alpha), -lateral * np.cos(alpha)])


def _put_load(columns: Mapping[str, Array]) -> None:
    """Compute the columns of the load from those of the joints."""
    joints = np.column_stack([columns[name] for name in (*POSITIONS, *ANGLES)])
    for name, values in zip(LOAD, load_of(joints).T, strict=True):
        columns[name][:] = values


def _scenario(mapping: MeasuredMap, rig: RigParameters, time_ns: NDArray[np.int64], table: Array) -> Scenario:
    """Return what is known of a measured run in the words of a scenario."""
    period = float(time_ns[1]) / NANOSECONDS
    x, y, rope = table[0, :5:2].tolist()
    step = LAB_STEP * sqrt(rig.length_scale)  # drives and swing of a larger crane are slower
    settings = {
        "name": mapping.name,
        "title": mapping.title,
        "duration": float(time_ns[-1]) / NANOSECONDS,
        "reference": {"start": [x, y, -abs(rope)]},
        "control": {"period": period, "physics_step": longest_step(period, step)},
        "workspace": {"on_exit": "record"},
        "log": {"every": 1},
        "rig": rig.model_dump(mode="json"),
    }
    return MeasuredScenario.from_table(settings, "the measured run")


def describe_files(files: Sequence[Path], mapping: MeasuredMap) -> str:
    """Return where a measured run is from: the files with their digests, and the map."""
    digests = []
    for path in files:
        with path.open("rb") as stream:
            digests.append(f"{path.name} (SHA-256 {hashlib.file_digest(stream, 'sha256').hexdigest()})")
    texts = mapping.model_dump_json(exclude_defaults=True, by_alias=True)
    return f"measured: {', '.join(digests)}\nmap: {texts}"
