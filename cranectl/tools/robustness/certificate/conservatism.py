"""Measure how conservative the certificate is: compare certified limits with the true stability limits.

The search increases the delay, and then the lag of the drives, from the scenario's values. It notes where the
certificate ends and where a pole of the linear loop leaves the unit circle. The tracker always compensates
the scenario's original lag.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

from cranectl.plants import DRIVES, Drive
from cranectl.scenario import Scenario
from cranectl.tools.robustness.certificate.certify import NominalLoop
from cranectl.tools.robustness.certificate.linear_plant import run_plant
from cranectl.tools.robustness.certificate.loop import InnerLoop
from cranectl.tools.robustness.certificate.operating_points import OperatingPoint

MAX_EXAMINED_DELAY = 0.3  # [s]
MAX_EXAMINED_LAG = 1.0  # [s]
STRIDE = 16  # first stride of the search
LAG_STEP = 1e-3  # [s]


@dataclass(frozen=True)
class LargestValues:
    """The largest certified and stable values at one point; None if the scenario's own value fails.

    The search ends at the delay `MAX_EXAMINED_DELAY` and at the additional lag `MAX_EXAMINED_LAG`.
    """

    point: OperatingPoint
    delay_certified: float | None  # [s]
    delay_stable: float | None
    lag_certified: float | None  # time constant of the slowest drive [s]; None also for ideal drives
    lag_stable: float | None

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data; the lowest bandwidth of the servos [rad/s] is 1/lag."""
        fields = asdict(self)
        return {**fields.pop("point"), **fields}


def find_limits(
    nominal_loop: NominalLoop, scenario: Scenario, point: OperatingPoint, drive: Drive
) -> LargestValues:
    """Find the largest delay and the largest lag at `point`, each with the other as in `scenario`."""
    plant = nominal_loop.plant(scenario, point, drive)

    def delayed(samples: int) -> InnerLoop:
        return nominal_loop.close(replace(plant, delay=samples))

    def lagging(steps: int) -> InnerLoop:
        slower = run_plant(with_further_lag(scenario, steps * LAG_STEP), drive)
        return nominal_loop.close(nominal_loop.plant(scenario, point, drive, slower))

    def stable(inner: InnerLoop) -> bool:
        return inner.closed_loop_radius(nominal_loop.opening.axis.robustifier) < 1.0

    def find_both_limits(loop: Callable[[int], InnerLoop], first: int, last: int) -> list[int | None]:
        certified = find_last_passing(lambda k: nominal_loop.certifies(loop(k)), first, last)
        return [certified, find_last_passing(lambda k: stable(loop(k)), first, last)]

    delays = find_both_limits(delayed, plant.delay, round(MAX_EXAMINED_DELAY / nominal_loop.period))
    lags = (
        find_both_limits(lagging, 0, round(MAX_EXAMINED_LAG / LAG_STEP))
        if DRIVES[drive].is_servo
        else [None, None]
    )
    slowest = float(scenario.rig.time_constants.max())
    return LargestValues(
        point,
        *(None if k is None else round(k * nominal_loop.period, 9) for k in delays),
        *(None if k is None else round(slowest + k * LAG_STEP, 9) for k in lags),
    )


def with_further_lag(scenario: Scenario, lag: float) -> Scenario:
    """Return `scenario` with `lag` [s] added to the time constants of all three drives."""
    names = ("bridge_time_constant", "trolley_time_constant", "winch_time_constant")
    rig = scenario.rig.model_copy(update={name: getattr(scenario.rig, name) + lag for name in names})
    return scenario.model_copy(update={"rig": rig})


def find_last_passing(passes: Callable[[int], bool], first: int, last: int) -> int | None:
    """Find the last number that passes, by growing strides and bisection; None if `first` fails."""
    if not passes(first):
        return None
    low, stride = first, STRIDE
    while (high := low + stride) <= last and passes(high):
        low, stride = high, 2 * stride
    high = min(high, last + 1)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if passes(middle) else (low, middle)
    return low
