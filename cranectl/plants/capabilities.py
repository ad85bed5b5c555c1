"""Check which effects and drives a plant can show, and refuse a run with others before it starts."""

from math import isclose

from cranectl.plants.plant import DRIVES, Drive
from cranectl.plants.registry import PARTS, PLANTS, WHOLE_EFFECTS, PlantEntry, labels_of
from cranectl.scenario import EFFECTS, EffectSettings, Scenario
from cranectl.support import InputError

USE_VELOCITY = "take '--drive velocity'"
SAME_NUMBER = 1e-6  # largest relative difference of a number of the rig and the one built into a plant
TOGETHER = ("rope", "body", "frame")  # effects that the same plants show


def check_scenario(scenario: Scenario, *, plant: str, drive: Drive) -> None:
    """Raise InputError if a plant cannot show a scenario with `drive`.

    It refuses what `check_effects` refuses, disturbances that the plant lacks, and numbers of the rig that
    differ from those built into the plant.
    """
    check_effects(scenario.effects, plant=plant, drive=drive)
    entry = PLANTS.entry(plant)
    joints = any(step.joint is not None for step in scenario.disturbances)
    for name, acting in (("disturbances", joints), ("disturbances.force", scenario.forced)):
        if acting and (reason := entry.why_lacking(name)):
            capable, remedy = _capable(entry, name)
            what = "forces among the disturbances" if name == "disturbances.force" else name
            raise InputError(
                f"{what} on the {entry.label} plant, {reason}",
                allowed=f"disturbances = [], or {capable}",
                remedy=f"{remedy.partition(', or ')[0]}, or add --set 'disturbances=[]'",
            )
    stated = {name: getattr(scenario.rig, name) for name in entry.fixed}
    built_in = {
        name: f"{value:g}" for name, value in entry.fixed.items() if not _is_same(stated[name], value)
    }
    if built_in:
        settings = " ".join(f"--set rig.{name}={value}" for name, value in built_in.items())
        raise InputError(
            f"{', '.join(f'rig.{name} = {stated[name]:g}' for name in built_in)} on the {entry.label} plant, "
            f"which has {', '.join(built_in.values())} built in",
            allowed=", ".join(f"rig.{name} = {value}" for name, value in built_in.items()),
            remedy=f"add {settings}, or choose other plants with --plants",
        )


def _is_same(stated: float, built_in: float) -> bool:
    """Return True for the number that is built into a plant, and for what messages print of it."""
    return isclose(stated, built_in, rel_tol=SAME_NUMBER) or f"{stated:g}" == f"{built_in:g}"


def check_effects(effects: EffectSettings, *, plant: str, drive: Drive) -> None:
    """Raise InputError for an unknown plant, for drives that it lacks and for effects that it cannot show.

    Friction of the cardan joint, wind, sensing and delay suit every plant and drive. Limits of velocity and
    acceleration and the dead zone need set-points, which only velocity drives have. Friction of the axes and
    limits of force need velocity or force drives, and a plant that shows them.
    """
    entry = PLANTS.entry(plant)
    if drive not in entry.drives:
        raise InputError(
            f"{drive} drives on the {entry.label} plant",
            allowed=f"{' and '.join(entry.drives)} drives",
            remedy=f"take '--drive {entry.drives[0]}'",
        )
    kind = DRIVES[drive]
    if effects.limits is not None and not kind.limits:
        raise InputError(
            "[effects.limits] with ideal drives, which reach any acceleration",
            allowed="velocity drives, or force drives with limits of force only",
            remedy=f"{USE_VELOCITY}, or leave the effect out",
        )
    if kind.command != "velocity":
        _check_no_set_points(effects, entry, drive)
    for name in WHOLE_EFFECTS:
        if getattr(effects, name) is not None and (reason := entry.why_lacking(name)):
            capable, remedy = _capable(entry, name)
            raise InputError(
                f"[effects.{name}] on the {entry.label} plant, {reason}",
                allowed=f"{capable} for rope, body and frame" if name in TOGETHER else capable,
                remedy=remedy,
            )
    for name, part in PARTS.items():
        effect, _, setting = name.partition(".")
        own = getattr(effects, effect)
        if own is None or not part.acts(getattr(own, setting)):
            continue
        none = getattr(own.with_numbers({setting: part.none}), setting)
        setting = f"effects.{name} = {list(none) if isinstance(none, tuple) else none}"
        if reason := entry.why_lacking(name):
            capable, remedy = _capable(entry, name)
            raise InputError(
                f"effects.{name} on the {entry.label} plant, {reason}",
                allowed=f"{setting}, or {capable}{' with velocity or force drives' if part.on_axes else ''}",
                remedy=f"{remedy}; or set {setting}",
            )
        if kind.is_prescribed and part.on_axes:
            raise InputError(
                f"effects.{name} with ideal drives, which move as commanded under any force",
                allowed=f"{setting}, or velocity or force drives",
                remedy=f"{USE_VELOCITY} or '--drive force'; or set {setting}",
            )


def _check_no_set_points(effects: EffectSettings, entry: PlantEntry, drive: Drive) -> None:
    idle = {
        f"effects.{effect}.{name}": none
        for effect, own in effects
        if own is not None
        for name in own.set_points
        if getattr(own, name) != (none := getattr(own.with_numbers(own.set_points), name))
    }
    if idle:
        settings = " and ".join(
            f"{name} = [{', '.join(f'{number:g}' for number in none)}]" for name, none in idle.items()
        )
        raise InputError(
            f"{' and '.join(idle)} with {drive} drives, which take no set-points",
            allowed="velocity drives, or values without effect",
            remedy=f"{USE_VELOCITY}; or set {settings}" if "velocity" in entry.drives else f"set {settings}",
        )


def honoured_effects(
    entry: PlantEntry, effects: EffectSettings, drive: Drive
) -> tuple[EffectSettings, tuple[str, ...]]:
    """Return `effects` without what a plant lacks or its drives do not take, and the names of that."""
    update, left_out = dict[str, object](), []
    for name in effects.names:
        kind, effect = EFFECTS[name], getattr(effects, name)
        idle = {part: own.none for part, own in kind.parts.items() if entry.why_lacking(f"{name}.{part}")}
        if DRIVES[drive].command != "velocity":
            idle |= kind.set_points
        if entry.why_lacking(name) or idle.keys() == kind.model_fields.keys():
            update[name] = None
            left_out.append(name)
        elif idle:
            update[name] = effect.with_numbers(idle)
            left_out += [f"{name}.{part}" for part in idle]
    return effects.model_copy(update=update), tuple(left_out)


def _capable(entry: PlantEntry, effect: str) -> tuple[str, str]:
    """Return the labels of the plants that show `effect`, and the remedy for `entry`, which does not."""
    able = [other for other in PLANTS.values() if not other.why_lacking(effect)]
    names = ",".join(other.argument for other in able if not other.package)
    if "file" in entry.arguments:
        return labels_of(able), f"leave the effect out, or take '--plants {names}' in place of the model"
    return labels_of(able), f"take '--plants {names}', or leave the effect out"
