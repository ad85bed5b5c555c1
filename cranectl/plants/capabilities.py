"""Check which effects and drives a plant can show, and refuse a run with others before it starts."""

from collections.abc import Callable, Mapping, Sequence
from math import isclose
from typing import Any

from cranectl.plants.plant import DRIVES, Drive, Plant
from cranectl.scenario import EFFECTS, EffectSettings, Scenario
from cranectl.support import InputError

USE_VELOCITY = "take '--drive velocity'"
SAME_NUMBER = 1e-6  # largest relative difference of a number of the rig and the one built into a plant
TOGETHER = ("rope", "body", "frame")  # effects that the same plants show
# Effects that a plant shows or lacks as a whole, and parts of the other effects.
WHOLE_EFFECTS = [
    name for name, kind in EFFECTS.items() if not kind.is_staged and (kind.is_structural or not kind.parts)
]
PARTS = {
    f"{name}.{part}": declared for name, kind in EFFECTS.items() for part, declared in kind.parts.items()
}
# What a plant may lack: effects, parts of effects, all forces on its axes, and disturbances of its load.
LACKS = (*WHOLE_EFFECTS, *PARTS, "force", "disturbances", "disturbances.force")
# A plant shows these effects unless it declares that it lacks them; others only if it declares them.
COMMON = ("limits", "friction", "rope", "body", "wind", "frame", "installation")


class Capabilities:
    """What a plant can show of a scenario, by its declarations; see `PlantEntry`."""

    name: str
    label: str
    drives: tuple[Drive, ...]
    shows: Sequence[str] | None
    lacks: Mapping[str, str]
    fixed: Mapping[str, float]
    delay: float
    arguments: Mapping[str, Any]

    def load(self) -> Callable[..., Plant]:
        """Return the class of the plant, imported now; raise InputError if it is not installed."""
        raise NotImplementedError

    def why_lacking(self, setting: str) -> str | None:
        """Return why the plant does not honour a setting, or the effect that it is part of, or None."""
        above = "disturbances" if setting == "disturbances.force" else ""
        if setting in PARTS:
            above = "force" if PARTS[setting].on_axes else setting.partition(".")[0]
        return self.lack(setting) or self.lack(above)

    def lack(self, setting: str) -> str | None:
        """Return why the plant does not honour `setting`, one of LACKS, or None if no reason is declared."""
        effect = setting.partition(".")[0]
        is_undeclared = setting in (*WHOLE_EFFECTS, *PARTS) and not self._shows(effect)
        return self.lacks.get(setting, "which does not show it" if is_undeclared else None)

    def _shows(self, effect: str) -> bool:
        """Return True if an effect is declared; load the plant only for one that is not COMMON."""
        if self.shows is not None:
            return effect in self.shows
        if effect in COMMON:
            return True
        try:
            return effect in getattr(self.load(), "shows", ())
        except (InputError, ImportError):  # not installed
            return False

    def check_scenario(self, scenario: Scenario, drive: Drive) -> None:
        """Raise InputError if the plant cannot show a scenario with `drive`.

        It refuses what `check_effects` refuses, disturbances that the plant lacks, and numbers of the rig
        that differ from those built into the plant. The delay of its drives must be part of the scenario's.
        """
        self.check_effects(scenario.effects, drive)
        joints = any(step.joint is not None for step in scenario.disturbances)
        for name, acting in (("disturbances", joints), ("disturbances.force", scenario.forced)):
            if acting and (reason := self.why_lacking(name)):
                capable, remedy = self._capable(name)
                what = "forces among the disturbances" if name == "disturbances.force" else name
                raise InputError(
                    f"{what} on the {self.label} plant, {reason}",
                    allowed=f"disturbances = [], or {capable}",
                    remedy=f"{remedy.partition(', or ')[0]}, or add --set 'disturbances=[]'",
                )
        stated = {name: getattr(scenario.rig, name) for name in self.fixed}
        built_in = {
            name: f"{value:g}" for name, value in self.fixed.items() if not _is_same(stated[name], value)
        }
        if built_in:
            settings = " ".join(f"--set rig.{name}={value}" for name, value in built_in.items())
            raise InputError(
                f"{', '.join(f'rig.{name} = {stated[name]:g}' for name in built_in)} "
                f"on the {self.label} plant, which has {', '.join(built_in.values())} built in",
                allowed=", ".join(f"rig.{name} = {value}" for name, value in built_in.items()),
                remedy=f"add {settings}, or choose other plants with --plants",
            )

        given = scenario.effects.delay.seconds if scenario.effects.delay else 0.0
        if given < self.delay:
            raise InputError(
                f"effects.delay.seconds = {given:g} on the {self.label} plant, whose drives have a delay of "
                f"{self.delay:g} s",
                allowed=f"{self.delay:g} s or more, for all plants",
                remedy=f"add --set effects.delay.seconds={self.delay:g}",
            )

    def check_effects(self, effects: EffectSettings, drive: Drive) -> None:
        """Raise InputError for drives that the plant lacks and for effects that it cannot show.

        Friction of the cardan joint, wind, sensing and delay suit every plant and drive. Limits of velocity
        and acceleration and the dead zone need set-points, which only velocity drives have. Friction of the
        axes and limits of force need velocity or force drives, and a plant that shows them.
        """
        if drive not in self.drives:
            raise InputError(
                f"{drive} drives on the {self.label} plant",
                allowed=f"{' and '.join(self.drives)} drives",
                remedy=f"take '--drive {self.drives[0]}'",
            )
        kind = DRIVES[drive]
        if effects.limits is not None and not kind.limits:
            raise InputError(
                "[effects.limits] with ideal drives, which reach any acceleration",
                allowed="velocity drives, or force drives with limits of force only",
                remedy=f"{USE_VELOCITY}, or leave the effect out",
            )
        if kind.command != "velocity":
            self._check_no_set_points(effects, drive)
        for name in WHOLE_EFFECTS:
            if getattr(effects, name) is not None and (reason := self.why_lacking(name)):
                capable, remedy = self._capable(name)
                raise InputError(
                    f"[effects.{name}] on the {self.label} plant, {reason}",
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
            if reason := self.why_lacking(name):
                capable, remedy = self._capable(name)
                drives = " with velocity or force drives" if part.on_axes else ""
                raise InputError(
                    f"effects.{name} on the {self.label} plant, {reason}",
                    allowed=f"{setting}, or {capable}{drives}",
                    remedy=f"{remedy}; or set {setting}",
                )
            if kind.is_prescribed and part.on_axes:
                raise InputError(
                    f"effects.{name} with ideal drives, which move as commanded under any force",
                    allowed=f"{setting}, or velocity or force drives",
                    remedy=f"{USE_VELOCITY} or '--drive force'; or set {setting}",
                )

    def _check_no_set_points(self, effects: EffectSettings, drive: Drive) -> None:
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
                remedy=f"{USE_VELOCITY}; or set {settings}"
                if "velocity" in self.drives
                else f"set {settings}",
            )

    def honoured(self, effects: EffectSettings, drive: Drive) -> tuple[EffectSettings, tuple[str, ...]]:
        """Return `effects` without what the plant lacks or its drives do not take, and the names of that."""
        update, left_out = dict[str, object](), []
        for name in effects.names:
            kind, effect = EFFECTS[name], getattr(effects, name)
            idle = {part: own.none for part, own in kind.parts.items() if self.why_lacking(f"{name}.{part}")}
            if DRIVES[drive].command != "velocity":
                idle |= kind.set_points
            if self.why_lacking(name) or idle.keys() == kind.model_fields.keys():
                update[name] = None
                left_out.append(name)
            elif idle:
                update[name] = effect.with_numbers(idle)
                left_out += [f"{name}.{part}" for part in idle]
        return effects.model_copy(update=update), tuple(left_out)

    def _capable(self, effect: str) -> tuple[str, str]:
        """Return the labels of the plants that show `effect`, and the remedy for this one, which does not."""
        from cranectl.plants.registry import PLANTS, labels_of

        able = [other for other in PLANTS.values() if not other.why_lacking(effect)]
        names = ",".join(other.argument for other in able if not other.package)
        if "file" in self.arguments:
            return labels_of(able), f"leave the effect out, or take '--plants {names}' in place of the model"
        return labels_of(able), f"take '--plants {names}', or leave the effect out"


def _is_same(stated: float, built_in: float) -> bool:
    """Return True for the number that is built into a plant, and for what messages print of it."""
    return isclose(stated, built_in, rel_tol=SAME_NUMBER) or f"{stated:g}" == f"{built_in:g}"
