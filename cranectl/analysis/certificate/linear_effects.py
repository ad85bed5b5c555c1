"""Which part of a scenario's effects is linear and enters the linearised plant, and which is left out."""

from cranectl.effects.settings import EffectSettings

NONE = (0.0, 0.0, 0.0)


def plant_effects(effects: EffectSettings) -> EffectSettings:
    """What of `effects` makes the MuJoCo plant another linear plant.

    Rope, taut; body; frame; viscous friction; drag at the mean wind. Delay and the observer belong to the
    computer, see `linear_plant`.
    """
    friction, wind = effects.friction, effects.wind
    return EffectSettings(
        rope=effects.rope,
        body=effects.body,
        frame=effects.frame,
        friction=friction and friction.model_copy(update={"coulomb": NONE, "pivot_coulomb": 0.0}),
        wind=wind and wind.model_copy(update={"gust": 0.0}),
    )


def taken_in(effects: EffectSettings) -> list[str]:
    """What of `effects` the linear loop has, by name."""
    found = [name for name in ("delay", "rope", "body", "frame") if getattr(effects, name)]
    friction = effects.friction
    if effects.sensing:
        found.append("sensing.observer_bandwidth")
    if friction:
        found += [
            f"friction.{name}" for name in ("viscous", "pivot_viscous") if _any(getattr(friction, name))
        ]
    if effects.wind:
        found.append("wind.mean")
    return found


def left_out(effects: EffectSettings) -> list[str]:
    """What of `effects` is not linear or not of the loop, by name."""
    found = ["limits"] if effects.limits else []
    sensing, friction, wind = effects.sensing, effects.friction, effects.wind
    if sensing:
        settings = ("position_resolution", "angle_resolution", "position_noise", "angle_noise")
        found += [f"sensing.{name}" for name in settings if _any(getattr(sensing, name))]
    if friction:
        found += [
            f"friction.{name}" for name in ("coulomb", "pivot_coulomb") if _any(getattr(friction, name))
        ]
    if wind and wind.gust > 0.0:
        found.append("wind.gust")
    if effects.installation:
        found.append("installation")
    return found


def _any(value: float | tuple[float, ...]) -> bool:
    return any(value) if isinstance(value, tuple) else value > 0.0
