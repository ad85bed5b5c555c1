"""Which effects and drives a plant can show: what it cannot is refused rather than left out silently.

A plant of another package is tried before its first run: what its entry does not exclude must act. A setting
that a plant accepts and ignores would make runs that look different and are not. So each setting is changed
by itself over some milliseconds, and the plant must react: a disturbance accelerates the load, and a heavier
load raises the tension.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cranectl.plants.plant import DRIVES, Drive
from cranectl.plants.registry import PLANTS, PlantEntry, labels_of, plant_entry
from cranectl.scenario.effects import EFFECTS, NO_EFFECTS, PARTS, WHOLE_EFFECTS, EffectSettings, Wind, spread
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.scenario import Scenario
from cranectl.signals import ALPHA, BETA
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

USE_VELOCITY = "take '--drive velocity'"
TOGETHER = ("rope", "body", "frame")  # that the same plants show

PROBE_PERIOD, PROBE_PERIODS = 1e-3, 50  # [s], and how many
REACTION = 0.01  # least part of the reaction that a point load on a rigid rope would show
RIG = RigParameters()
SECONDS = PROBE_PERIOD * PROBE_PERIODS
STILL, BREEZE = Wind(gust=0.0), Wind(gust=0.0, drag_area=0.02)
AIR = 10.0  # [m/s]
TENSION, LOAD_VELOCITY = 6, 3  # columns of what a plant says of its load


def check_scenario(scenario: Scenario, *, plant: str, drive: Drive) -> None:
    """Raise InputError for anything of a scenario that a plant cannot show with `drive`.

    That is what `check_effects` refuses, disturbances that the plant lacks, and numbers of the rig other than
    those that are built into it.
    """
    check_effects(scenario.effects, plant=plant, drive=drive)
    entry = plant_entry(plant)
    joints = any(step.joint is not None for step in scenario.disturbances)
    for name, acting in (("disturbances", joints), ("disturbances.force", scenario.forced)):
        if acting and (reason := lacking(entry, name)):
            capable, remedy = _capable(name)
            what = "forces among the disturbances" if name == "disturbances.force" else name
            raise InputError(
                f"{what} on the {entry.label} plant, {reason}",
                allowed=f"disturbances = [], or {capable}",
                remedy=f"{remedy.partition(', or ')[0]}, or add --set 'disturbances=[]'",
            )
    for name, value in entry.fixed.items():
        given = getattr(scenario.rig, name)
        if given != value:
            raise InputError(
                f"rig.{name} = {given:g} on the {entry.label} plant, which has {value:g} built in",
                allowed=f"rig.{name} = {value:g}",
                remedy=f"add --set rig.{name}={value:g}, or choose other plants with --plants",
            )


def check_effects(effects: EffectSettings, *, plant: str, drive: Drive) -> None:
    """Raise InputError for an unknown plant, drives it lacks, effects that it cannot show with `drive`.

    Friction of the cardan joint, wind, sensing and delay suit every plant and drive. Limits of velocity and
    acceleration and the dead zone are of set-points, which velocity drives have. Friction of the axes and
    limits of force suit velocity and force drives, on plants that know them.
    """
    entry = plant_entry(plant)
    if drive not in entry.drives:
        raise InputError(
            f"{drive} drives on the {entry.label} plant",
            allowed=f"{' and '.join(entry.drives)} drives",
            remedy=f"take '--drive {entry.drives[0]}'",
        )
    kind = DRIVES[drive]
    if effects.limits is not None and not kind.limits:
        raise InputError(
            "[effects.limits] with ideal drives, which take accelerations and realise any",
            allowed="velocity drives; force drives with limits of force alone",
            remedy=f"{USE_VELOCITY}, or leave the effect out",
        )
    if kind.command != "velocity":
        _check_no_set_points(effects, drive)
    for name in WHOLE_EFFECTS:
        if getattr(effects, name) is not None and (reason := lacking(entry, name)):
            capable, remedy = _capable(name)
            raise InputError(
                f"[effects.{name}] on the {entry.label} plant, {reason}",
                allowed=f"{capable} for rope, body and frame" if name in TOGETHER else capable,
                remedy=remedy,
            )
    for name, part in PARTS.items():
        effect, _, setting = name.partition(".")
        own = getattr(effects, effect)
        if own is None or not part.acts(value := getattr(own, setting)):
            continue
        none = spread(part.none, value)
        setting = f"effects.{name} = {list(none) if isinstance(none, tuple) else none}"
        if reason := lacking(entry, name):
            capable, remedy = _capable(name)
            raise InputError(
                f"effects.{name} on the {entry.label} plant, {reason}",
                allowed=f"{setting}, or {capable}{' with velocity or force drives' if part.on_axes else ''}",
                remedy=f"{remedy}; or set {setting}",
            )
        if kind.is_prescribed and part.on_axes:
            raise InputError(
                f"effects.{name} with ideal drives, which move as commanded whatever the force",
                allowed=f"{setting}, or velocity or force drives",
                remedy=f"{USE_VELOCITY} or '--drive force'; or set {setting}",
            )


def _check_no_set_points(effects: EffectSettings, drive: Drive) -> None:
    for effect in effects.names:
        for name, none in EFFECTS[effect].set_points.items():
            value = getattr(getattr(effects, effect), name)
            idle = spread(none, value)
            if value != idle:
                setting = f"effects.{effect}.{name} = {list(idle)}"
                raise InputError(
                    f"effects.{effect}.{name} with {drive} drives, which take no set-points",
                    allowed=f"{setting}, or velocity drives",
                    remedy=f"{USE_VELOCITY}; or set {setting}",
                )


def _capable(effect: str) -> tuple[str, str]:
    """The plants that show `effect`, and what to do to have it, in words."""
    able = [entry for entry in PLANTS.values() if not lacking(entry, effect)]
    names = ",".join(entry.name for entry in able if not entry.package)
    return labels_of(able), f"take '--plants {names}', or leave the effect out"


def lacking(entry: PlantEntry, setting: str) -> str | None:
    """Return why a plant does not honour a setting, None if it does."""
    above = "disturbances" if setting == "disturbances.force" else ""
    if setting in PARTS:
        above = "force" if PARTS[setting].on_axes else setting.partition(".")[0]
    return entry.lack(setting) or entry.lack(above)


@dataclass(frozen=True)
class ProbeRun:
    """What a plant is made for, where it starts and what acts on it."""

    scaled: Mapping[str, float] = field(default_factory=dict)  # numbers of the rig, by what factor
    effects: EffectSettings = NO_EFFECTS
    swinging: bool = False
    driven: bool = False
    disturbance: tuple[float, ...] = (0.0, 0.0)
    wind: tuple[float, ...] = (0.0,) * 6


Outcome = tuple[Array, Array]  # state (10,), load (7,)


@dataclass(frozen=True)
class Probe:
    """A setting, two trials that differ in it, and what must differ in their outcomes."""

    setting: str  # as `lacks` has it, or rig.FIELD
    without: ProbeRun
    given: ProbeRun
    reacts: Callable[[Outcome, Outcome], bool]


_tried: dict[tuple[str, Drive], tuple[PlantEntry, tuple[str, ...]]] = {}  # in this process


def check_honest(name: str, drive: Drive) -> None:
    """Raise InputError if a plant of another package ignores what its entry does not exclude."""
    entry = plant_entry(name)
    if entry.where.startswith("cranectl."):  # held to the equations by tests
        return
    tried = _tried.get((name, drive))
    if tried is None or tried[0] is not entry:
        tried = _tried[name, drive] = entry, _ignored(entry, drive)
    if ignored := tried[1]:
        raise InputError(
            f"the {entry.label} plant accepts {', '.join(ignored)} with {drive} drives and does not react",
            allowed="plants whose entry excludes what they ignore",
            remedy=f"correct the plant, or declare it in its PlantEntry: {_declaration(ignored)}",
        )


def _declaration(ignored: tuple[str, ...]) -> str:
    lacks = [f"'{name}': 'which has none'" for name in ignored if not name.startswith("rig.")]
    rig = [name.removeprefix("rig.") for name in ignored if name.startswith("rig.")]
    fixed = [f"'{name}': {getattr(RIG, name):g}" for name in rig]
    told = (("lacks", lacks), ("fixed", fixed))
    return ", ".join(f"{field}={{{', '.join(numbers)}}}" for field, numbers in told if numbers)


def _ignored(entry: PlantEntry, drive: Drive) -> tuple[str, ...]:
    """Return the settings to which a plant does not react."""
    found = dict[str, None]()
    for probe in _probes(entry, drive):
        try:
            without, given = (_outcome(entry, drive, trial) for trial in (probe.without, probe.given))
        except InputError:  # the plant itself refuses the setting
            continue
        if not probe.reacts(without, given):
            found[probe.setting] = None
    return tuple(found)


def _probes(entry: PlantEntry, drive: Drive) -> Iterator[Probe]:
    """Yield those that the entry and the drive admit."""
    for probe in (*_pushes(), *_parameters(drive), *_effects(entry, drive)):
        if lacking(entry, probe.setting) is None and probe.setting.removeprefix("rig.") not in entry.fixed:
            yield probe


def _pushes() -> Iterator[Probe]:
    rest = ProbeRun()
    for disturbance, angle in (((1.0, 0.0), ALPHA), ((0.0, 1.0), BETA)):
        pushed = ProbeRun(disturbance=disturbance)
        yield Probe("disturbances", rest, pushed, _grows(0, angle + 1, 1.0 * SECONDS))
    blow = 0.5 * BREEZE.density * BREEZE.drag_area * AIR**2  # [N]
    for setting, wind, acting, force in (
        ("disturbances.force", STILL, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0), 1.0),
        ("wind", BREEZE, (AIR, 0.0, 0.0, 0.0, 0.0, 0.0), blow),
    ):
        still = ProbeRun(effects=EffectSettings(wind=wind))
        expected = force / RIG.load_mass * SECONDS
        yield Probe(setting, still, replace(still, wind=acting), _grows(1, LOAD_VELOCITY, expected))


def _parameters(drive: Drive) -> Iterator[Probe]:
    rest, moving = ProbeRun(), ProbeRun(swinging=True, driven=True)
    for name, factor in (("load_mass", 2.0), ("gravity", 1.5)):
        given = replace(rest, scaled={name: factor})
        yield Probe(f"rig.{name}", rest, given, _grows(1, TENSION, RIG.weight))
    part = "time_constant" if DRIVES[drive].is_servo else "mass"
    for axis in () if DRIVES[drive].is_prescribed else ("bridge", "trolley", "winch"):
        name = f"{axis}_{part}"
        yield Probe(f"rig.{name}", moving, replace(moving, scaled={name: 2.0}), _differs)


def _effects(entry: PlantEntry, drive: Drive) -> Iterator[Probe]:
    moving = ProbeRun(swinging=True, driven=True)
    for name in WHOLE_EFFECTS:
        if name != "wind":  # which `_pushes` tries
            yield Probe(name, moving, _with_effect(moving, name, {}), _differs)
    for setting, part in PARTS.items():
        name, _, key = setting.partition(".")
        kind = DRIVES[drive]
        is_moved = entry.servos if kind.is_servo else not kind.is_prescribed
        if (part.on_axes and not is_moved) or (name == "limits" and not kind.is_servo):
            continue
        numbers = {each: other.none for each, other in EFFECTS[name].parts.items()}
        without = _with_effect(moving, name, numbers)
        given = _with_effect(moving, name, {**numbers, key: part.tried})
        yield Probe(setting, without, given, _differs)


def _with_effect(trial: ProbeRun, name: str, numbers: Mapping[str, float]) -> ProbeRun:
    usual = EFFECTS[name]()
    update = {key: spread(number, getattr(usual, key)) for key, number in numbers.items()}
    return replace(trial, effects=NO_EFFECTS.model_copy(update={name: usual.model_copy(update=update)}))


def _grows(part: int, column: int, expected: float) -> Callable[[Outcome, Outcome], bool]:
    def reacts(without: Outcome, given: Outcome) -> bool:
        return bool(given[part][column] - without[part][column] > REACTION * expected)

    return reacts


def _differs(without: Outcome, given: Outcome) -> bool:
    return any(not np.array_equal(a, b) for a, b in zip(without, given, strict=True))


def _outcome(entry: PlantEntry, drive: Drive, trial: ProbeRun) -> Outcome:
    """Return where some periods lead; raise InputError as the plant does."""
    base = RIG.model_copy(update=dict(entry.fixed))
    rig = base.model_copy(
        update={name: factor * getattr(base, name) for name, factor in trial.scaled.items()}
    )
    plant: Any = entry.load()(rig, drive=drive, step=PROBE_PERIOD, substeps=1, effects=trial.effects)
    length = float(np.mean(RIG.rope_range))
    state = np.array([np.mean(RIG.bridge_range), 0.0, np.mean(RIG.trolley_range), 0.0, length, *(0.0,) * 5])
    state[ALPHA], state[BETA] = (0.1, 0.05) if trial.swinging else (0.0, 0.0)
    plant.check_length(length)
    plant.reset(state)
    command = np.full(3, 0.2 if trial.driven else 0.0)
    if DRIVES[drive].at_rest == "weight":
        command = 10.0 * command
        command[2] -= RIG.weight  # holds the load
    load = np.zeros(7)
    disturbance, wind = np.array(trial.disturbance), np.array(trial.wind)
    for _ in range(PROBE_PERIODS):
        plant.advance(command, disturbance, wind, load)
    plant.measure(state)
    return state, load
