"""Simulate plants side by side without a fixed end, in blocks, with a controller that may change in between.

Without intervention, a session gives exactly the numbers of `simulate_run`. When a user drives the load by
hand, it gives the numbers of the scenario that `driven_scenario` returns. After the end of the scenario, it
holds the last reference point and the last disturbances. Time never goes back, not even at a new start.
"""

from collections.abc import Iterable

import numpy as np

from cranectl.design import ControllerDesign
from cranectl.plants import PLANTS, Drive, Plant
from cranectl.scenario import NANOSECONDS, Disturbance, Scenario
from cranectl.signals import Z
from cranectl.simulate import Encoders, Loop, Plan, PreparedController, Run
from cranectl.support import TakesTurns
from cranectl.tools.live.hand import RELEASED, HandReference, HandRequest, check_can_be_driven


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
        self.plan = Plan.of(scenario)
        self.origin_ns = origin_ns  # time of the last start
        self._samples = 0  # since the last start
        self._active_pulses: list[Disturbance] = []
        self._all_pulses: list[Disturbance] = []  # since the last start
        self._hand: HandReference | None = None  # None until a user drives by hand
        self._controller = PreparedController.of(scenario, design, drive, self.plan)
        period = scenario.period_ns / NANOSECONDS
        samples = round(Scenario.MAX_SECONDS / period) + 1  # enough noise and gusts for the longest run
        still = scenario.effects.wind is None
        self._air_velocity = scenario.air_velocity(1 if still else samples)
        sensing = scenario.effects.sensing
        self._encoders = Encoders.of(sensing, samples) if sensing else None
        self._plants = [PLANTS.make(name, scenario, drive) for name in PLANTS.to_run(plants)]
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
        reference, disturbance, wind = self.plan.rows_at(index)
        if self._hand:
            reference = self._hand.rows(index)
        for pulse in self._active_pulses:
            disturbance[pulse.acts(index * self.scenario.period_ns)] += pulse.acceleration
        wind[:, :3] = self._air_velocity[np.minimum(index, len(self._air_velocity) - 1)]
        runs = [loop.part(samples, (reference, disturbance, wind)) for loop in self._loops]
        self._samples += samples
        now = self._samples * self.scenario.period_ns / NANOSECONDS
        self._active_pulses = [pulse for pulse in self._active_pulses if pulse.end and pulse.end > now]
        return runs

    def use(self, design: ControllerDesign) -> None:
        """Continue with another controller as `Loop.use` does; raise InputError if it is unstable."""
        controller = PreparedController.of(self.scenario, design, self.drive, self.plan)
        if self._hand:
            check_can_be_driven(design)
        self._controller, self.design = controller, design
        for loop in self._loops:
            loop.use(controller)
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
        loop = Loop(self.plan, plant, self._controller, endless=True)
        loop.origin_ns = self.origin_ns
        if loop.path and self._encoders:
            loop.path = loop.path._replace(encoders=self._encoders)
        loop.bind()
        return loop
