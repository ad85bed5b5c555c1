"""Simulate plants side by side without a fixed end, in blocks, with a controller that may change in between.

Without intervention, a session gives exactly the numbers of `simulate_run`. When a user drives the load by
hand, it gives the numbers of the scenario that `driven_scenario` returns. After the end of the scenario, it
holds the last reference point and the last disturbances. Time never goes back, not even at a new start.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from cranectl.controllers import MEMORY
from cranectl.design import ControllerDesign
from cranectl.live.hand import RELEASED, HandReference, HandRequest, check_can_be_driven
from cranectl.plants import PLANTS, Drive, Plant, air_velocity
from cranectl.scenario import NANOSECONDS, Disturbance, Scenario
from cranectl.signals import Z
from cranectl.simulate import (
    Loop,
    Run,
    make_encoders,
    make_plant,
    plan_scenario,
    prepare_controller,
    rows_at,
)
from cranectl.support import Array, TakesTurns


def _carried_over_size(before: ControllerDesign, after: ControllerDesign, memory: Array) -> int:
    """Return how many memory values the next controller takes over; zero outside the flat family."""
    old, new = before.axis_design, after.axis_design
    if old is None or new is None:
        return 0
    return len(memory) if new.robustifier is old.robustifier else MEMORY.robustifier


class Session(TakesTurns):
    """Advances several plants together; a plant that has stopped waits for the next start."""

    def __init__(
        self,
        scenario: Scenario,
        design: ControllerDesign,
        *,
        plants: Iterable[str] = (),
        drive: Drive = "ideal",
        origin_ns: int = 0,
    ) -> None:
        """Prepare the session at the time `origin_ns`; raise InputError as `simulate_run` does."""
        self.scenario, self.design, self.drive = scenario, design, drive
        self.plan = plan_scenario(scenario)
        self.origin_ns = origin_ns  # time of the last start
        self._samples = 0  # since the last start
        self._active_pulses: list[Disturbance] = []
        self._all_pulses: list[Disturbance] = []  # since the last start
        self._hand: HandReference | None = None  # None until a user drives by hand
        self._compiled = prepare_controller(scenario, design, drive, self.plan)
        period = scenario.period_ns / NANOSECONDS
        samples = round(Scenario.MAX_SECONDS / period) + 1  # enough noise and gusts for the longest run
        still = scenario.effects.wind is None
        self._air_velocity = air_velocity(scenario.effects, 1 if still else samples, period)
        sensing = scenario.effects.sensing
        self._encoders = make_encoders(sensing, samples) if sensing else None
        self._plants = [make_plant(name, scenario, drive) for name in PLANTS.to_run(plants)]
        self._start()

    @property
    def now_ns(self) -> int:
        """Time of the next sample."""
        return self.origin_ns + self._samples * self.scenario.period_ns

    @property
    def moving(self) -> bool:
        """Whether any plant has not stopped."""
        return any(not loop.is_finished for loop in self._loops)

    def prepare(self) -> None:
        """Compile all code that this machine has not compiled yet, so that the first block is not delayed."""
        self.advance(1)
        self._samples = 0
        self._start()

    def advance(self, samples: int) -> list[Run]:
        """Return the next increment of every plant's run; it has no rows if the plant had stopped before."""
        index = np.arange(self._samples, self._samples + samples)
        reference = self._reference(index)
        disturbance = self._disturbance(index)
        wind = rows_at(self.plan.wind, index)
        wind[:, :3] = rows_at(self._air_velocity, index)
        runs = [loop.part(samples, (reference, disturbance, wind)) for loop in self._loops]
        self._samples += samples
        now = self._samples * self.scenario.period_ns / NANOSECONDS
        self._active_pulses = [pulse for pulse in self._active_pulses if pulse.end and pulse.end > now]
        return runs

    def use(self, design: ControllerDesign) -> None:
        """Continue with another controller; raise InputError if it is unstable at this control period.

        The set-points carry over. Between two controllers of the flat family, the dynamic extension carries
        over too. So do the states of the robustifier, if both use the same one. Any other controller begins
        at the present reference.
        """
        compiled = prepare_controller(self.scenario, design, self.drive, self.plan)
        if self._hand:
            check_can_be_driven(design)
        self._compiled = compiled
        before, self.design = self.design, design
        for loop in self._loops:
            loop.use(compiled, design, carried=_carried_over_size(before, design, loop.memory))
            if self._hand:
                loop.follow(self._hand.table)

    def pulse(self, acceleration: tuple[float, float], seconds: float) -> None:
        """Add angular accelerations of alpha and beta [rad/s²] from the next sample on, for `seconds`."""
        length = max(1, round(seconds * NANOSECONDS / self.scenario.period_ns))
        period = self.scenario.period_ns / NANOSECONDS
        start, end = self._samples * period, (self._samples + length) * period
        for joint, size in zip(("alpha", "beta"), acceleration, strict=True):
            table = {"joint": joint, "start": start, "end": end, "magnitude": size}
            self._all_pulses.append(Disturbance.model_validate(table))
        self._active_pulses += self._all_pulses[-2:]

    def steer(self, request: HandRequest) -> None:
        """Drive the load by hand from the next sample on, with a velocity or to a point.

        Raises InputError if driving by hand is not possible.
        """
        if self._hand is None and request != RELEASED:
            check_can_be_driven(self.design)
            hand = HandReference(self.scenario, self._samples)
            for loop in self._loops:
                loop.plant.check_length(-float(hand.limits.high[Z]))
            self._hand = hand
            for loop in self._loops:
                loop.follow(hand.table)
        if self._hand:
            self._hand.follow(self._samples, request)

    def driven_scenario(self) -> Scenario | None:
        """Return the scenario that repeats the driving by hand since the start, or None if there was none."""
        return self._hand.scenario(self._samples, self.design.name, self._all_pulses) if self._hand else None

    def reset(self) -> None:
        """Start the scenario again from its initial state; the session's time goes on."""
        self.origin_ns, self._samples, self._hand = self.now_ns, 0, None
        self._active_pulses, self._all_pulses = [], []
        self._start()

    def _start(self) -> None:
        self._loops = [self._begin(plant) for plant in self._plants]

    def _begin(self, plant: Plant) -> Loop:
        """Return a loop at the start of the scenario, with noise for the longest run."""
        loop = Loop(self.scenario, plant, self._compiled, self.plan, design=self.design, endless=True)
        loop.origin_ns = self.origin_ns
        if loop.path and self._encoders:
            loop.path = loop.path._replace(encoders=self._encoders)
        loop.bind()
        return loop

    def _reference(self, index: NDArray[np.intp]) -> Array:
        """Return the reference at the next samples `index` (n,): shape (n, 15)."""
        if self._hand:
            return self._hand.rows(index)
        return rows_at(self.plan.reference, index)

    def _disturbance(self, index: NDArray[np.intp]) -> Array:
        """Return the disturbances of scenario and pulses at samples `index` (n,): shape (n, 2)."""
        rows = rows_at(self.plan.disturbance, index)
        for pulse in self._active_pulses:
            rows[pulse.acts(index * self.scenario.period_ns)] += pulse.acceleration
        return rows
