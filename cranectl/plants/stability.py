"""Whether steps and effects of a plant suit its rope; what each plant must refuse alike."""

from cranectl.plants.plant import StepError
from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.quantities import MIN_DURATION
from cranectl.scenario.scenario import longest_step
from cranectl.support.errors import InputError

# RK4 is stable for |rate · step| below 2.6 in all directions of decay (Hairer, Wanner: Solving Ordinary
# Differential Equations II, figure IV.2.1), the method of Dormand and Prince below 3.3; at 2 both still damp
# a vibration within a few periods.
LARGEST = 2.0


def check_hook(effects: EffectSettings, length: float) -> None:
    """Raise InputError for a rope of `length` [m], to the load, that does not reach its hook."""
    if effects.body and length <= effects.body.hook_offset:
        raise InputError(
            f"a rope length of {length:g} m, to the load, with effects.body.hook_offset = "
            f"{effects.body.hook_offset:g}",
            allowed="rope lengths beyond hook_offset",
            remedy="lower the path or reduce hook_offset",
        )


def check_rate(rate: float, effects: EffectSettings, length: float, *, step: float, period: float) -> None:
    """Raise StepError where the integrator would be unstable: `rate` [1/s] is the largest modulus of a pole.

    With the longest step that would do and divides the control period `period` [s]. The rope is `length` [m].
    """
    if rate * step > LARGEST:
        enough = longest_step(period, LARGEST / rate)
        raise StepError(
            f"a crane with {', '.join(effects.names)} and {length:g} m of rope: something vibrates or decays "
            f"with {rate:.3g} 1/s, too fast for steps of {step:g} s",
            allowed=f"rates up to {LARGEST / step:.3g} 1/s at this step",
            remedy=(
                f"set control.physics_step to {enough:g} or less; or choose a softer rope or frame, "
                "a heavier winch, or a body with more inertia"
            )
            if enough >= MIN_DURATION
            else "choose a softer rope or frame, a heavier winch, or a body with more inertia",
            step=enough,
        )
