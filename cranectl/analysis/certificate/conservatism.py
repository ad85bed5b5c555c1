"""How conservative the certificate is: what it certifies against what the true linear loop survives.

Delay and lag of the drives are raised from the scenario's values, one by one, until the certificate refuses
and until a pole of the loop leaves the unit circle. The tracker goes on to compensate the scenario's lag.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

from cranectl.analysis.certificate.certify import NominalLoop
from cranectl.analysis.certificate.linear_plant import run_plant
from cranectl.analysis.certificate.loop import InnerLoop, closed_loop_radius
from cranectl.analysis.certificate.operating_points import OperatingPoint
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario import Scenario

MOST_DELAY = 0.3  # [s]
MOST_LAG = 1.0  # [s]
STRIDE = 16  # of the search, first
LAG_STEP = 1e-3  # [s]


@dataclass(frozen=True)
class LargestValues:
    """The largest values certified and survived at one point; None where not even the scenario's are.

    What is survived beyond the end of the search, `MOST_DELAY` or further `MOST_LAG`, counts as that.
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
    """Raise delay, then lag, at `point`; the other stays as in `scenario`."""
    plant = nominal_loop.plant(scenario, point, drive)

    def delayed(samples: int) -> InnerLoop:
        return nominal_loop.close(replace(plant, delay=samples))

    def lagging(steps: int) -> InnerLoop:
        slower = run_plant(with_further_lag(scenario, steps * LAG_STEP), drive)
        return nominal_loop.close(nominal_loop.plant(scenario, point, drive, slower))

    def stable(inner: InnerLoop) -> bool:
        return closed_loop_radius(inner, nominal_loop.opening.axis.robustifier) < 1.0

    def both(loop: Callable[[int], InnerLoop], first: int, most: int) -> list[int | None]:
        certified = last_good(lambda k: nominal_loop.certifies(loop(k)), first, most)
        return [certified, last_good(lambda k: stable(loop(k)), first, most)]

    delays = both(delayed, plant.delay, round(MOST_DELAY / nominal_loop.period))
    lags = both(lagging, 0, round(MOST_LAG / LAG_STEP)) if DRIVES[drive].is_servo else [None, None]
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


def last_good(good: Callable[[int], bool], first: int, most: int) -> int | None:
    """Return the last number before a failure, by growing strides and halving; None if `first` fails."""
    if not good(first):
        return None
    low, stride = first, STRIDE
    while (high := low + stride) <= most and good(high):
        low, stride = high, 2 * stride
    high = min(high, most + 1)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return low
