"""How far the two plants may differ with velocity drives: the load's reaction on the engine's servos.

The analytic lag is blind to the load, the engine's servo yields to it. The difference of the two is that of
two levels of the error budget, so it has an estimate and a bound before either plant is run.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cranectl.analysis.budget.propagation import Deviation, higher_orders, plant_errors, propagate
from cranectl.analysis.budget.trajectory_loop import (
    Nominal,
    TrajectoryLoop,
    ideal_run,
    linearise_run,
    linearised,
    nominal_run,
)
from cranectl.compare.agreement import Limits, NoLimits
from cranectl.design import Design
from cranectl.scenario import Scenario
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.signals import ALPHA, BETA
from cranectl.simulate import Run
from cranectl.status import RunStatus

ROUNDING = 2e-12  # [m] and [rad]


@dataclass(frozen=True)
class PlantDifference:
    """Largest differences over a run; infinite bounds where the reaction is too large for a first order."""

    load_m: float
    load_bound_m: float
    angle_rad: float
    angle_bound_rad: float


def predict_plant_difference(scenario: Scenario, controller: str | None = None) -> PlantDifference:
    """MuJoCo plant less analytic plant, both with velocity drives, without running either so."""
    return _difference(nominal_run(scenario, controller))


def predicted_limits(scenario: Scenario, design: Design) -> Limits | NoLimits:
    """The bound of the plants' difference with velocity drives, as limits of their agreement.

    Runs that go on to the end stop at other times, if at all, by the lag of the slowest drive.
    """
    if scenario.effects != NO_EFFECTS:
        return NoLimits("velocity drives beside other effects have no predicted bound")
    run = ideal_run(scenario, design)
    if run.status != RunStatus.COMPLETED:
        return NoLimits(f"a run that ends early, {run.status.label}, has no predicted bound")
    difference = _difference(linearised(run, scenario))
    if not np.isfinite([difference.load_bound_m, difference.angle_bound_rad]).all():
        return NoLimits("the load's reaction on the drives is too large for a bound to first order")
    return Limits(
        load_m=difference.load_bound_m,
        angle_rad=difference.angle_bound_rad,
        end_s=float(scenario.rig.time_constants.max()),
        reason="the load's reaction on the engine's servos, carried through the loop along this very run",
        source="predicted for this scenario and controller",
    )


def _difference(nominal: Nominal) -> PlantDifference:
    run = nominal.run
    loops = (nominal.driven(), linearise_run(run, drive="velocity"))
    orders = list(zip(*(_orders(run, loop) for loop in loops), strict=True))
    # Means over a sample stand for signals: of a servo of lag tau they miss T / (2 tau).
    coarse = nominal.loop.period / (2.0 * float(run.scenario.rig.time_constants.min()))
    loads = [float(np.linalg.norm(a.load - b.load, axis=1).max()) for a, b in orders]
    joints = [ALPHA, BETA]
    angles = [float(np.abs(a.state[:, joints] - b.state[:, joints]).max()) for a, b in orders]
    return PlantDifference(loads[0], _bound(loads, coarse), angles[0], _bound(angles, coarse))


def _orders(run: Run, loop: TrajectoryLoop) -> tuple[Deviation, Deviation, Deviation]:
    """What the drives of `loop` do to the run: first, second and third order."""
    ports = plant_errors(loop)
    first = propagate(loop, ports)
    return first, *higher_orders(run, loop, ports, first)


def _bound(orders: Sequence[float], coarse: float) -> float:
    """The first of three orders, what it leaves out, and what means over a sample miss.

    Infinite where the orders do not fall: neither the third to half the second, as in
    `analysis.budget.prediction`, nor both together to a tenth of the first.
    """
    estimate, second, third = orders
    left = second + 2.0 * third
    if third > max(0.5 * second, ROUNDING) and left > 0.1 * estimate:
        return np.inf
    return (1.0 + coarse) * estimate + left + ROUNDING
