"""Choose the physics step with which all plants agree, from the drives and the size of a rigid crane.

MuJoCo's RK4 is the least accurate integrator of all plants. Per step it errs by (h / T)⁵ / 120 of the motion
that decays or turns with the time T. The measured velocity then errs, feedback acts on it, and the load moves
by a share of (h / T)⁴. This share grows with the motion, hence with the crane, while the limit of 1e-7 m does
not. A sweep over lags of 1 to 500 ms, steps of 50 µs to 20 ms, all drives and cranes up to 100 m gave the
condition. Within it, no difference was above half of the limit (tests/plants/test_steps.py).
"""

from math import sqrt

from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario import RigParameters, Scenario, longest_step, nanoseconds

STEPS_PER_TIME = 20.0  # in the shortest lag, and in the swing's 1 / ω
SWEPT_ROPE = 1.4  # [m]; longest rope of the crane with the most violent runs of the sweep
SIZE_POWER = 0.25  # a load that errs by h⁴ times its rope's length


def longest_agreeing_step(rig: RigParameters, drive: Drive) -> float:
    """Return the longest physics step [s] with which all plants agree to 1e-7 m and rad on a rigid crane.

    It is a twentieth of the fastest time of the crane, less on ropes longer than SWEPT_ROPE. These times are
    the lags of velocity drives, and 1 / ω of a load that swings on the shortest rope. Where drives feel the
    load, it swings against the trolley's mass: ω² = (g / l) (1 + load / trolley).
    """
    kind = DRIVES[drive]
    heaviness = 0.0 if kind.is_prescribed else rig.load_mass / rig.trolley_mass
    fastest = sqrt(rig.rope_range[0] / (rig.gravity * (1.0 + heaviness)))
    if kind.is_servo:
        fastest = min(fastest, float(rig.time_constants.min()))
    size = max(1.0, rig.rope_range[1] / SWEPT_ROPE)
    return float(fastest / (STEPS_PER_TIME * size**SIZE_POWER))


def physics_step(scenario: Scenario, drive: Drive) -> float:
    """Return the physics step [s] of a run: what the scenario states, or else the default for its crane."""
    stated = scenario.control.physics_step
    if stated is not None:
        return stated
    return scenario.control.default_step(longest_agreeing_step(scenario.rig, drive))


def substeps(scenario: Scenario, drive: Drive) -> int:
    """Return the number of physics steps in a control period."""
    return scenario.period_ns // nanoseconds(physics_step(scenario, drive))


def with_step(scenario: Scenario, drive: Drive) -> Scenario:
    """Return `scenario` with the physics step of its run stated, as records and logs have it."""
    if scenario.control.physics_step is not None:
        return scenario
    control = scenario.control.model_copy(update={"physics_step": physics_step(scenario, drive)})
    return scenario.model_copy(update={"control": control})


def is_short_enough(scenario: Scenario, drive: Drive) -> bool:
    """Return True if the physics step keeps the condition under which all plants agree."""
    allowed = longest_agreeing_step(scenario.rig, drive) * (1.0 + scenario.control.STEP_ROUNDING)
    return physics_step(scenario, drive) <= allowed


def describe_step(scenario: Scenario, drive: Drive) -> str:
    """Return the physics step of a run in words, and whether all plants agree with it on a rigid crane."""
    longest = longest_agreeing_step(scenario.rig, drive) * (1.0 + scenario.control.STEP_ROUNDING)
    fits = longest_step(scenario.control.period, longest)
    promise = (
        "rigid plants agree to 1e-7 m and rad"
        if is_short_enough(scenario, drive)
        else ("agreement to 1e-7 m and rad is judged, not promised")
    )
    return f"{physics_step(scenario, drive):g} s; {promise} (condition: at most {fits:g} s)"
