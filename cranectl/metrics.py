"""Figures that sum up one run."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.signals import WORKSPACE_SIGNALS
from cranectl.simulate import Run

Array = NDArray[np.float64]

NEARLY_SLACK = 0.15  # of the load's weight: below this tension the rope is drawn as about to go slack


@dataclass(frozen=True)
class WorkspaceViolation:
    """Where and how far a run left the workspace."""

    signal: str
    first_time_s: float
    max_excess_m: float


@dataclass(frozen=True)
class RunMetrics:
    """Summary of one run; accelerations and angles are signed extremes over the run."""

    duration_s: float
    max_error_m: float
    rms_error_m: float
    final_error_m: float
    final_load_m: tuple[float, float, float]
    max_acceleration_m_s2: tuple[float, float, float]  # bridge, trolley, rope
    min_acceleration_m_s2: tuple[float, float, float]
    rms_acceleration_m_s2: tuple[float, float, float]  # commanded: the effort
    max_abs_angle_rad: tuple[float, float]  # alpha, beta
    rms_sway_rad: float  # of the angle between rope and plumb line
    min_rope_tension_n: float
    workspace_violations: tuple[WorkspaceViolation, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def run_metrics(run: Run) -> RunMetrics | None:
    """Metrics of `run` over its recorded samples; None for a run that stopped before its first."""
    if not len(run.time_ns):
        return None
    load = run.block("load")[:, :3]
    error = np.linalg.norm(run.reference[:, :3] - load, axis=1)
    inputs = run.block("input")[:, :3]
    angles = run.block("state")[:, [6, 8]]
    return RunMetrics(
        duration_s=run.end_ns / 1e9,
        max_error_m=float(error.max()),
        rms_error_m=float(np.sqrt(np.mean(error**2))),
        final_error_m=float(error[-1]),
        final_load_m=_triple(load[-1]),
        max_acceleration_m_s2=_triple(inputs.max(axis=0)),
        min_acceleration_m_s2=_triple(inputs.min(axis=0)),
        rms_acceleration_m_s2=_triple(np.sqrt(np.mean(inputs**2, axis=0))),
        max_abs_angle_rad=(float(np.abs(angles[:, 0]).max()), float(np.abs(angles[:, 1]).max())),
        rms_sway_rad=float(np.sqrt(np.mean(np.arccos(np.cos(angles).prod(axis=1)) ** 2))),
        min_rope_tension_n=float(run.signal("load.rope_tension").min()),
        workspace_violations=workspace_violations(run),
    )


def workspace_excess(run: Run) -> Array:
    """How far bridge, trolley and rope are outside their ranges [m], shape (N, 3), 0 inside."""
    positions = run.block("state")[:, [0, 2, 4]]
    low, high = run.scenario.rig.workspace.T
    excess: Array = np.maximum(np.maximum(low - positions, positions - high), 0.0)
    return excess


def workspace_violations(run: Run) -> tuple[WorkspaceViolation, ...]:
    """One entry for each of bridge, trolley, rope that left its range."""
    excess = workspace_excess(run)
    return tuple(
        WorkspaceViolation(name, float(run.time[np.argmax(column > 0.0)]), float(column.max()))
        for name, column in zip(WORKSPACE_SIGNALS, excess.T, strict=True)
        if column.max() > 0.0
    )


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
