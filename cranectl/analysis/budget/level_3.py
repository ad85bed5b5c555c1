"""How far apart the two plants may be with velocity drives: the load's reaction on the engine's servos.

The analytic lag is blind to the load, the engine's servo yields to it. The difference of the two is that of
two rungs of the error budget, so it has an estimate and a bound before either plant is run.
"""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.nominal import nominal_run
from cranectl.analysis.budget.propagation import Deviation, plant_errors, propagate
from cranectl.analysis.budget.remainder import second_order
from cranectl.analysis.budget.trajectory_loop import linearise_run
from cranectl.scenario import Scenario

Array = NDArray[np.float64]

ROUNDING = 2e-12  # [m] and [rad]


@dataclass(frozen=True)
class PlantDifference:
    """Largest differences over a run; infinite bounds where the reaction is too large for a first order."""

    load_m: float
    load_bound_m: float
    angle_rad: float
    angle_bound_rad: float

    def to_json(self) -> dict[str, float]:
        """Plain data."""
        return asdict(self)


def predict_plant_difference(scenario: Scenario, controller: str | None = None) -> PlantDifference:
    """MuJoCo plant less analytic plant, both with velocity drives, without running either so."""
    nominal = nominal_run(scenario, controller)
    loops = (nominal.driven(), linearise_run(nominal.run, drive="velocity"))
    first = [propagate(loop, plant_errors(loop)) for loop in loops]
    second = [
        second_order(nominal.run, loop, plant_errors(loop), found)
        for loop, found in zip(loops, first, strict=True)
    ]
    coarse = nominal.loop.period / (2.0 * float(scenario.rig.time_constants.min()))
    load, angle = (_largest(first[0], first[1], what) for what in ("load", "angle"))
    left_load, left_angle = (_largest(second[0], second[1], what) for what in ("load", "angle"))
    return PlantDifference(
        load, _bound(load, left_load, coarse), angle, _bound(angle, left_angle, coarse)
    )  # fmt: skip


def _largest(a: Deviation, b: Deviation, what: str) -> float:
    if what == "load":
        return float(np.linalg.norm(a.load - b.load, axis=1).max())
    return float(np.abs(a.state[:, [6, 8]] - b.state[:, [6, 8]]).max())


def _bound(estimate: float, left: float, coarse: float) -> float:
    """As in `analysis.budget.prediction`, with the second order for what the first leaves out."""
    return (1.0 + coarse) * estimate + 2.0 * left + ROUNDING if left <= 0.25 * estimate + ROUNDING else np.inf
