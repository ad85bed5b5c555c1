"""Which effects a plant and its drives can show; the others are refused rather than left out silently."""

from cranectl.plants.registry import PLANTS, plant_entry
from cranectl.scenario.effects import NO_LIMIT, DriveLimits, EffectSettings
from cranectl.support.errors import InputError

USE_VELOCITY = "take '--drive velocity'"


def check_effects(effects: EffectSettings, *, plant: str, drive: str) -> None:
    """Raise InputError for an unknown plant, drives it lacks, effects that it cannot show with `drive`.

    Friction of the cardan joint, wind, sensing and delay suit every plant and drive; limits of velocity and
    acceleration are of set-points, which velocity drives have on both plants. Friction of the axes and limits
    of force suit velocity and force drives, on plants that know them.
    """
    entry = plant_entry(plant)
    if drive not in entry.drives:
        raise InputError(
            f"{drive} drives on the {entry.label} plant",
            allowed=f"{' and '.join(entry.drives)} drives",
            remedy=f"take '--drive {entry.drives[0]}'",
        )
    if effects.limits is not None and drive == "ideal":
        raise InputError(
            "[effects.limits] with ideal drives, which take accelerations and realise any",
            allowed="velocity drives; force drives with limits of force alone",
            remedy=f"{USE_VELOCITY}, or leave the effect out",
        )
    if effects.limits is not None and drive == "force":
        _check_no_set_points(effects.limits)
    for name in ("rope", "body", "frame"):
        if getattr(effects, name) is not None and name in entry.lacks:
            capable, remedy = _capable(name)
            raise InputError(
                f"[effects.{name}] on the {entry.label} plant, {entry.lacks[name]}",
                allowed=f"{capable} for rope, body and frame",
                remedy=remedy,
            )
    for name, zero in _forces(effects):
        if "force" in entry.lacks:
            capable, remedy = _capable("force")
            raise InputError(
                f"{name} on the {entry.label} plant, {entry.lacks['force']}",
                allowed=f"{name} = {zero}, or {capable} with velocity or force drives",
                remedy=f"{remedy}; or set {name} = {zero}",
            )
        if drive == "ideal":
            raise InputError(
                f"{name} with ideal drives, which move as commanded whatever the force",
                allowed=f"{name} = {zero}, or velocity or force drives",
                remedy=f"{USE_VELOCITY} or '--drive force'; or set {name} = {zero}",
            )


def _check_no_set_points(limits: DriveLimits) -> None:
    for name in ("velocity", "acceleration"):
        if min(getattr(limits, name)) < NO_LIMIT:
            raise InputError(
                f"effects.limits.{name} with force drives, which take no set-points",
                allowed=f"effects.limits.{name} = {[NO_LIMIT] * 3}, or velocity drives",
                remedy=f"{USE_VELOCITY}; or set effects.limits.{name} = {[NO_LIMIT] * 3}",
            )


def _capable(effect: str) -> tuple[str, str]:
    """The plants that show `effect`, and what to do to have it, in words."""
    able = [entry for entry in PLANTS.values() if effect not in entry.lacks]
    labels = " or ".join(entry.label for entry in able)
    return f"the {labels} plant", f"take '--plant {able[0].name}', or leave the effect out"


def _forces(effects: EffectSettings) -> list[tuple[str, str]]:
    """Settings that act on the forces of the driven axes, and the value that means none."""
    found: list[tuple[str, str]] = []
    if effects.limits and min(effects.limits.force) < NO_LIMIT:
        found.append(("effects.limits.force", str([NO_LIMIT] * 3)))
    if effects.friction:
        acting = [kind for kind in ("coulomb", "viscous") if any(getattr(effects.friction, kind))]
        found += [(f"effects.friction.{kind}", str([0.0] * 3)) for kind in acting]
    return found
