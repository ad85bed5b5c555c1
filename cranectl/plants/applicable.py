"""Which effects a plant and its drives can show; the others are refused rather than left out silently."""

from cranectl.scenario.effects import NO_LIMIT, EffectSettings
from cranectl.support.errors import InputError

USE_MUJOCO = "take '--plant mujoco', or leave the effect out"
USE_VELOCITY = "take '--drive velocity'"


def check_effects(effects: EffectSettings, *, plant: str, drive: str) -> None:
    """Raise InputError for effects that `plant` with `drive` cannot show.

    Friction of the cardan joint, wind, sensing and delay suit every plant and drive; limits of velocity and
    acceleration are of set-points, which velocity drives have on both plants.
    """
    if effects.limits is not None and drive == "ideal":
        raise InputError(
            "[effects.limits] with ideal drives, which take accelerations and realise any",
            allowed="velocity drives",
            remedy=f"{USE_VELOCITY}, or leave the effect out",
        )
    if plant == "analytic":
        for name in ("rope", "body", "frame"):
            if getattr(effects, name) is not None:
                raise InputError(
                    f"[effects.{name}] on the analytic plant, which has a rigid rope without mass, a point "
                    "load and a rigid frame",
                    allowed="the MuJoCo plant for rope, body and frame",
                    remedy=USE_MUJOCO,
                )
    for name, zero in _forces(effects):
        if plant == "analytic":
            raise InputError(
                f"{name} on the analytic plant, whose drives know no forces",
                allowed=f"{name} = {zero}, or the MuJoCo plant with velocity drives",
                remedy=f"{USE_MUJOCO}; or set {name} = {zero}",
            )
        if drive == "ideal":
            raise InputError(
                f"{name} with ideal drives, which move as commanded whatever the force",
                allowed=f"{name} = {zero}, or velocity drives",
                remedy=f"{USE_VELOCITY}; or set {name} = {zero}",
            )


def _forces(effects: EffectSettings) -> list[tuple[str, str]]:
    """Settings that act on the forces of the driven axes, and the value that means none."""
    found: list[tuple[str, str]] = []
    if effects.limits and min(effects.limits.force) < NO_LIMIT:
        found.append(("effects.limits.force", str([NO_LIMIT] * 3)))
    if effects.friction:
        acting = [kind for kind in ("coulomb", "viscous") if any(getattr(effects.friction, kind))]
        found += [(f"effects.friction.{kind}", str([0.0] * 3)) for kind in acting]
    return found
