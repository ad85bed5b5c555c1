"""Choose the physics step with which all plants agree, from the drives and the size of a rigid crane.

MuJoCo's RK4 is the least accurate integrator of all plants. Per step it errs by (h / T)⁵ / 120 of the motion
that decays or turns with the time T. The measured velocity then errs, feedback acts on it, and the load moves
by a share of (h / T)⁴. This share grows with the motion, hence with the crane, while the limit of 1e-7 m does
not. A sweep over lags of 1 to 500 ms, steps of 50 µs to 20 ms, all drives and cranes up to 100 m gave the
condition. Within it, no difference was above half of the limit (tests/plants/test_steps.py).
"""

from math import sqrt
from typing import NamedTuple

from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario import NANOSECONDS, RigParameters, Scenario, longest_step, nanoseconds

STEPS_PER_TIME = 20.0  # in the shortest lag, and in the swing's 1 / ω
SWEPT_ROPE = 1.4  # [m]; longest rope of the crane with the most violent runs of the sweep
MIN_STEP_NS = 1000  # as the shortest control period, so that a step is many of the clock's nanoseconds
SIZE_POWER = 0.25  # a load that errs by h⁴ times its rope's length


def longest_agreeing_step(rig: RigParameters, drive: Drive) -> float:
    """Return the longest physics step [s] with which all plants agree to 1e-7 m and rad on a rigid crane.

    It is a twentieth of the fastest time of the crane, less on ropes longer than SWEPT_ROPE. These times are
    the lags of velocity drives, and 1 / ω of a load that swings on the shortest rope. Where drives feel the
    load, it swings against the mass M of the trolley, or of bridge and trolley if only the bridge moves:
    ω² = (g / l) (1 + load / M).
    """
    kind, lightest = DRIVES[drive], rig.driven_masses[1 if "y" in rig.axes else 0]
    heaviness = 0.0 if kind.is_prescribed else rig.load_mass / lightest
    fastest = sqrt(rig.rope_range[0] / (rig.gravity * (1.0 + heaviness)))
    if kind.is_servo:
        fastest = min(fastest, float(rig.time_constants.min()))
    size = max(1.0, rig.rope_range[1] / SWEPT_ROPE)
    return float(fastest / (STEPS_PER_TIME * size**SIZE_POWER))


class PhysicsStep(NamedTuple):
    """The physics step of a run of `scenario` with `drive`."""

    scenario: Scenario  # what is run
    drive: Drive  # kind of drive

    @property
    def longest(self) -> float:
        """Longest step [s] with which all plants agree; see `longest_agreeing_step`."""
        return longest_agreeing_step(self.scenario.rig, self.drive)

    @property
    def seconds(self) -> float:
        """The step [s] that the scenario states, or else the default for its crane."""
        control = self.scenario.control
        return control.default_step(self.longest) if control.physics_step is None else control.physics_step

    @property
    def per_period(self) -> int:
        """Number of physics steps in a control period."""
        return self.scenario.period_ns // nanoseconds(self.seconds)

    @property
    def is_short_enough(self) -> bool:
        """Whether the step keeps the condition under which all plants agree."""
        return self.seconds <= self.longest * (1.0 + self.scenario.control.STEP_ROUNDING)

    def refined(self, times: int) -> Scenario | None:
        """Return the scenario with `times` as many steps, or None if that needs fractions of nanoseconds."""
        step_ns, rest = divmod(self.scenario.period_ns, self.per_period * times)
        if rest or step_ns < MIN_STEP_NS:
            return None
        control = self.scenario.control.model_copy(update={"physics_step": step_ns / NANOSECONDS})
        return self.scenario.model_copy(update={"control": control})

    def stated(self) -> Scenario:
        """Return the scenario with this step stated, as records and logs have it."""
        if self.scenario.control.physics_step is not None:
            return self.scenario
        control = self.scenario.control.model_copy(update={"physics_step": self.seconds})
        return self.scenario.model_copy(update={"control": control})

    def __str__(self) -> str:
        """Say the step in words, and whether all plants agree with it on a rigid crane."""
        fits = longest_step(
            self.scenario.control.period, self.longest * (1.0 + self.scenario.control.STEP_ROUNDING)
        )
        promise = (
            "rigid plants agree to 1e-7 m and rad"
            if self.is_short_enough
            else "agreement to 1e-7 m and rad is judged, not promised"
        )
        return f"{self.seconds:g} s; {promise} (condition: at most {fits:g} s)"
