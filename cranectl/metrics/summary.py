"""Figures that sum up one run; `docs/metrics.md` has their definitions as formulas."""

from dataclasses import asdict, dataclass
from math import inf, sqrt
from typing import Any

import numpy as np

from cranectl.metrics.accumulator import Accumulator, accumulate, empty_accumulator
from cranectl.metrics.setup import MetricsSetup, metrics_setup
from cranectl.metrics.workspace import WorkspaceViolation
from cranectl.scenario import NANOSECONDS
from cranectl.signals import WORKSPACE_SIGNALS
from cranectl.simulate import Run
from cranectl.status import RunStatus

Triple = tuple[float, float, float]  # bridge, trolley, rope; or x, y, z of the load


@dataclass(frozen=True)
class RunMetrics:
    """Summary of one run.

    The error e = z_d - z is of the load, its size the Euclidean norm. RMS is over samples. "Rest" is the time
    from which the reference stays in its end point; what is measured from there on is None for a run that has
    no two samples of it.
    """

    status: str  # how the run ended
    duration_s: float  # until then
    max_error_m: float  # largest |e|
    rms_error_m: float  # RMS of |e|
    final_error_m: float  # |e| at the last sample
    final_load_m: Triple  # z at the last sample
    rest_s: float  # when the reference comes to rest
    settling_time_s: float | None  # from rest until |e| stays within SETTLING_TOLERANCE; None if it does not
    overshoot_m: float | None  # largest way past the end point along the last motion; None without motion
    max_rest_error_m: float | None  # largest |e| from rest on
    residual_sway_rad: float | None  # largest angle between rope and plumb line from rest on
    residual_vibration_m: Triple | None  # half the range of z from rest on
    max_acceleration_m_s2: Triple  # commanded: largest, signed
    min_acceleration_m_s2: Triple  # smallest, signed
    rms_acceleration_m_s2: Triple  # RMS: the effort
    max_abs_angle_rad: tuple[float, float]  # largest |alpha|, |beta|
    max_sway_rad: float  # largest angle between rope and plumb line
    rms_sway_rad: float  # RMS of it
    min_rope_tension_n: float  # smallest, at samples
    drive_path_m: Triple  # integral of |velocity|
    load_path_m: float  # length of the load's path
    drive_energy_j: Triple  # integral of the drive's mechanical power where that is positive
    drive_work_j: Triple  # integral of all of it
    saturated_s: float  # time during which the limits of any drive act
    workspace_violations: tuple[WorkspaceViolation, ...]  # one for each axis that left its range

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def run_metrics(run: Run) -> RunMetrics | None:
    """Metrics of `run` over its recorded samples; None for a run that stopped before its first."""
    setup = metrics_setup(run.scenario, run.drive, flag_column=_flag_column(run))
    accumulator = empty_accumulator()
    table, reference = np.ascontiguousarray(run.table), np.ascontiguousarray(run.reference)
    accumulate(setup, accumulator, run.time_ns, table, reference, table)
    return finish(setup, accumulator, run.status, run.end_ns)


def workspace_violations(run: Run) -> tuple[WorkspaceViolation, ...]:
    """One entry for each of bridge, trolley, rope that left its range."""
    metrics = run_metrics(run)
    return () if metrics is None else metrics.workspace_violations


def finish(
    setup: MetricsSetup, accumulator: Accumulator, status: RunStatus, end_ns: int
) -> RunMetrics | None:
    """Metrics of a run all of whose samples are in `accumulator`; None if there are none."""
    total = accumulator[0]
    n = float(total["samples"])
    if not n:
        return None
    rests = total["rest_samples"] > 1.0
    settles = rests and not status.stopped and total["settled_since"] < inf
    moves = rests and setup.direction.any()
    vibration = 0.5 * (total["rest_load_highest"] - total["rest_load_lowest"])
    return RunMetrics(
        status=status.label,
        duration_s=end_ns / NANOSECONDS,
        max_error_m=float(total["error_max"]),
        rms_error_m=sqrt(total["error_squares"] / n),
        final_error_m=float(total["error_last"]),
        final_load_m=_triple(total["load"]),
        rest_s=setup.rest_ns / NANOSECONDS,
        settling_time_s=float(total["settled_since"] - setup.rest_ns) / NANOSECONDS if settles else None,
        overshoot_m=max(float(total["overshoot"]), 0.0) if moves else None,
        max_rest_error_m=float(total["rest_error_max"]) if rests else None,
        residual_sway_rad=float(total["rest_sway_max"]) if rests else None,
        residual_vibration_m=_triple(vibration) if rests else None,
        max_acceleration_m_s2=_triple(total["input_highest"]),
        min_acceleration_m_s2=_triple(total["input_lowest"]),
        rms_acceleration_m_s2=_triple(np.sqrt(total["input_squares"] / n)),
        max_abs_angle_rad=(float(total["alpha_max"]), float(total["beta_max"])),
        max_sway_rad=float(total["sway_max"]),
        rms_sway_rad=sqrt(total["sway_squares"] / n),
        min_rope_tension_n=float(total["tension_least"]),
        drive_path_m=_triple(total["drive_path"]),
        load_path_m=float(total["load_path"]),
        drive_energy_j=_triple(total["energy"]),
        drive_work_j=_triple(total["work"]),
        saturated_s=float(total["saturated_time"]),
        workspace_violations=tuple(
            WorkspaceViolation(
                signal,
                first_time_s=float(total["outside_first"][i]) / NANOSECONDS,
                max_excess_m=float(total["outside_excess"][i]),
                time_outside_s=float(total["outside_time"][i]),
            )
            for i, signal in enumerate(WORKSPACE_SIGNALS)
            if total["outside_excess"][i] > 0.0
        ),
    )


def _flag_column(run: Run) -> int:
    """Where the table of `run` has its flags of saturation, if it has any."""
    width = 0
    for group in run.groups:
        if group.name == "command":
            return width + 3
        width += len(group)
    return width


def _triple(values: Any) -> Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z
