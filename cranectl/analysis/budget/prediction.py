"""What each rung of the fidelity ladder will do to the load, said before it is run.

The nominal run is the sampled loop on the analytic plant with ideal drives. The effects of a rung and of all
below it are equivalent disturbances along it (`equivalent`, `estimator`), carried to first order through the
loop linearised along the run (`propagation`). Effects that depend on the motion are taken on the motion that
they lead to, found by repetition. The bound adds twice what is left out: the second-order term (`remainder`)
and the last change of the repetition.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.drive_errors import delayed, limited_commands, rubbed, servo_error
from cranectl.analysis.budget.equivalent import Equivalent, hold_error, integrator_error
from cranectl.analysis.budget.nominal import Nominal, Prediction
from cranectl.analysis.budget.propagation import (
    Deviation,
    DriveOperator,
    Ports,
    ideal_operator,
    no_errors,
    propagate,
)
from cranectl.analysis.budget.random_errors import exact, predict_noise, predict_quantisation, told_error
from cranectl.analysis.budget.remainder import second_order
from cranectl.analysis.deviation import size_of
from cranectl.effects.sensing import make_encoders

Array = NDArray[np.float64]

RUNGS = (
    "sampled", "engine", "servos", "limits", "observer", "noise", "quantisation", "delay", "friction"
)  # fmt: skip
ROUNDING = 2e-12  # [m], of runs of the engine with its huge inertias
REPETITIONS = 4
HOLD_TAIL = 0.25  # next term of the hold's expansion over the one that repetition adds


def predict_rungs(nominal: Nominal) -> Iterator[Prediction]:
    """Every rung's prediction, in the order of RUNGS; nothing of the ladder is run for it."""
    yield _predict_hold(nominal)
    loop = nominal.loop
    rest = Deviation(*(np.zeros_like(part) for part in propagate(loop, no_errors(loop))))
    path, anew, lost = _Path(rest, rest.load, 0.0), 0.0, False
    # Signals are means over a sample: of a servo of lag tau they miss T / (2 tau).
    coarse = 0.25 * loop.period / float(nominal.run.scenario.rig.time_constants.min())
    climbed: tuple[str, ...] = ()
    for rung in RUNGS[1:]:
        if rung == "noise":
            yield _beside(predict_noise(nominal), path, lost)
        elif rung == "quantisation":
            found = predict_quantisation(nominal, path.deviation)
            anew = found.estimate.max  # on another motion the steps fall anew
            yield _beside(found, path, lost)
        else:
            climbed += (rung,)
            higher = _find_path(nominal, climbed, path.deviation)
            load = higher.deviation.load - path.deviation.load
            left = size_of(higher.second - path.second).max + higher.change + path.change + anew
            left = left + coarse * size_of(path.deviation.load).max if load.any() else 0.0
            size = size_of(load)
            bound = _bound(size.max, left, size_of(higher.deviation.load).max)
            lost = lost or bound == np.inf
            yield Prediction(rung, size, np.inf if lost else bound, load)
            path = higher


class _Path(NamedTuple):
    """A predicted motion under several effects."""

    deviation: Deviation
    second: Array  # (N, 3) second-order term of the load [m]
    change: float  # of the load by the last repetition [m]


def _beside(found: Prediction, path: _Path, lost: bool) -> Prediction:
    """A random effect beside a motion that is known only so well, or not at all."""
    return replace(found, bound=np.inf if lost else found.bound + 2.0 * path.change)


def _find_path(nominal: Nominal, effects: tuple[str, ...], start: Deviation) -> _Path:
    """The motion under `effects`, each taken on the motion itself; `start` is the first guess."""
    deviation, change = start, np.inf
    for _ in range(REPETITIONS if len(effects) > 2 else 1):
        ports, operator = _join(nominal, effects, deviation)
        found = propagate(nominal.loop, ports, operator)
        change = float(np.abs(found.load - deviation.load).max())
        deviation = found
    second = second_order(nominal.run, nominal.loop, ports, deviation, operator).load
    return _Path(deviation, second, change if len(effects) > 2 else 0.0)


def _join(nominal: Nominal, effects: tuple[str, ...], on: Deviation) -> tuple[Ports, DriveOperator]:
    """All `effects` on the motion `on`: their signals together and the last operator."""
    total, operator = no_errors(nominal.loop), ideal_operator()
    for name in effects:
        found = _equivalent(nominal, name, on, operator)
        total = Ports(*(a + b for a, b in zip(total, found.ports, strict=True)))
        operator = found.operator
    return total, operator


def _equivalent(nominal: Nominal, name: str, on: Deviation, operator: DriveOperator) -> Equivalent:
    """The effect `name` on the motion `on`, with what the drives are without it."""
    run, loop, settings = nominal.run, nominal.loop, nominal.effects
    if name == "engine":
        return integrator_error(run, loop)
    if name == "servos":
        return servo_error(run, loop)
    if name == "limits":
        return limited_commands(run, loop, settings.limits, on, operator)
    if name == "observer":
        ports = no_errors(loop)
        encoders = make_encoders(exact(settings.sensing), len(run.time_ns))
        ports.measured[:] = told_error(nominal, encoders, on)
        return Equivalent(ports, operator)
    if name == "delay":
        commands = run.block("input")[:-1, :3] + on.commanded
        return delayed(loop, commands, settings.delay.seconds, operator)
    return rubbed(run, loop, settings.friction, on, operator)


def _bound(estimate: float, left: float, whole: float) -> float:
    """Estimate and twice what is left out: more than the sum of a series of ratio up to one half.

    Infinite if what is left out is more than a quarter of the `whole` deviation: no first order tells then.
    """
    return float(estimate + 2.0 * left + ROUNDING) if left <= max(0.25 * whole, ROUNDING) else np.inf


def _predict_hold(nominal: Nominal) -> Prediction:
    """The nominal run less the continuous-time ideal; the rest of the hold's expansion is left out too."""
    run, loop = nominal.run, nominal.loop
    found = hold_error(run, loop)
    deviations = [propagate(loop, found.ports)]
    for _ in range(2):
        found = hold_error(run, loop, deviations[-1])
        deviations.append(propagate(loop, found.ports))
    first, before, last = (deviation.load for deviation in deviations)
    back = Deviation(*(-part for part in deviations[-1]))
    second = second_order(run, loop, Ports(*(-part for part in found.ports)), back, ideal_operator())
    left = size_of(second.load).max + size_of(last - before).max + HOLD_TAIL * size_of(last - first).max
    size = size_of(last)
    return Prediction("sampled", size, _bound(size.max, left, size.max), last)
