"""Test a plant of another package before its first run: it must react to each setting that it accepts.

If a plant accepted a setting and ignored it, runs would differ in name only. So each setting is changed
alone, over some milliseconds, and the plant must react. For example, a disturbance must accelerate the load,
and a heavier load must raise the tension.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cranectl.plants.capabilities import lacking
from cranectl.plants.plant import DRIVES, Drive
from cranectl.plants.registry import PlantEntry, plant_entry
from cranectl.scenario.effects import EFFECTS, NO_EFFECTS, PARTS, WHOLE_EFFECTS, EffectSettings, Wind, spread
from cranectl.scenario.rig import RigParameters
from cranectl.signals import ALPHA, BETA, ROPE
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

PROBE_PERIOD, PROBE_PERIODS = 1e-3, 50  # control period [s], and number of periods
REACTION = 0.01  # least reaction, as a share of that of a point load on a rigid rope
RIG = RigParameters()
SECONDS = PROBE_PERIOD * PROBE_PERIODS
STILL, BREEZE = Wind(gust=0.0), Wind(gust=0.0, drag_area=0.02)
AIR = 10.0  # [m/s]
TENSION, LOAD_VELOCITY = 6, 3  # columns of the load's measurement, see `Plant.advance`


@dataclass(frozen=True)
class ProbeRun:
    """A short run: how the plant is made, whether it starts swinging, and what acts on it."""

    scaled: Mapping[str, float] = field(default_factory=dict)  # factors on numbers of the rig, by name
    effects: EffectSettings = NO_EFFECTS
    swinging: bool = False
    driven: bool = False
    disturbance: tuple[float, ...] = (0.0, 0.0)
    wind: tuple[float, ...] = (0.0,) * 6


Outcome = tuple[Array, Array]  # state (10,), load (7,)


@dataclass(frozen=True)
class Probe:
    """A setting, two runs that differ in it, and how their outcomes must differ."""

    setting: str  # a name as in `lacks`, or rig.FIELD
    without: ProbeRun
    changed: ProbeRun
    reacts: Callable[[Outcome, Outcome], bool]


_tried: dict[tuple[str, Drive], tuple[PlantEntry, tuple[str, ...]]] = {}  # in this process


def check_honest(name: str, drive: Drive) -> None:
    """Raise InputError if a plant ignores a setting that its entry does not exclude."""
    entry = plant_entry(name)
    tried = _tried.get((name, drive))
    if tried is None or tried[0] is not entry:
        tried = _tried[name, drive] = entry, _ignored(entry, drive)
    if ignored := tried[1]:
        raise InputError(
            f"the {entry.label} plant accepts {', '.join(ignored)} with {drive} drives and does not react",
            allowed="plants whose entry excludes each setting that they ignore",
            remedy=f"correct the plant, or declare it in its PlantEntry: {_declaration(ignored)}",
        )


def _declaration(ignored: tuple[str, ...]) -> str:
    """Return the arguments of `PlantEntry` that exclude the settings."""
    lacks = [f"'{name}': 'which has none'" for name in ignored if not name.startswith("rig.")]
    rig = [name.removeprefix("rig.") for name in ignored if name.startswith("rig.")]
    fixed = [f"'{name}': {getattr(RIG, name):g}" for name in rig]
    declarations = (("lacks", lacks), ("fixed", fixed))
    return ", ".join(f"{field}={{{', '.join(numbers)}}}" for field, numbers in declarations if numbers)


def _ignored(entry: PlantEntry, drive: Drive) -> tuple[str, ...]:
    """Return the settings to which a plant does not react."""
    ignored = dict[str, None]()
    for probe in _probes(entry, drive):
        try:
            without, with_setting = (_outcome(entry, drive, run) for run in (probe.without, probe.changed))
        except InputError:  # the plant itself refuses the setting
            continue
        if not probe.reacts(without, with_setting):
            ignored[probe.setting] = None
    return tuple(ignored)


def _probes(entry: PlantEntry, drive: Drive) -> Iterator[Probe]:
    """Yield the probes of all settings that the entry and the drive allow."""
    for probe in (*_probe_loads(entry), *_probe_rig(drive), *_probe_effects(entry, drive)):
        if lacking(entry, probe.setting) is None and probe.setting.removeprefix("rig.") not in entry.fixed:
            yield probe


def _probe_loads(entry: PlantEntry) -> Iterator[Probe]:
    """Yield a probe of each disturbance, of a force on the load and of the wind."""
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
        expected = force / entry.fixed.get("load_mass", RIG.load_mass) * SECONDS
        yield Probe(setting, still, replace(still, wind=acting), _grows(1, LOAD_VELOCITY, expected))


def _probe_rig(drive: Drive) -> Iterator[Probe]:
    """Yield a probe of each number of the rig."""
    rest, moving = ProbeRun(), ProbeRun(swinging=True, driven=True)
    for name, factor in (("load_mass", 2.0), ("gravity", 1.5)):
        scaled = replace(rest, scaled={name: factor})
        yield Probe(f"rig.{name}", rest, scaled, _grows(1, TENSION, RIG.weight))
    part = "time_constant" if DRIVES[drive].is_servo else "mass"
    for axis in () if DRIVES[drive].is_prescribed else ("bridge", "trolley", "winch"):
        name = f"{axis}_{part}"
        yield Probe(f"rig.{name}", moving, replace(moving, scaled={name: 2.0}), _differs)


def _probe_effects(entry: PlantEntry, drive: Drive) -> Iterator[Probe]:
    """Yield a probe of each effect but the wind, and of each part of an effect."""
    moving = ProbeRun(swinging=True, driven=True)
    for name in WHOLE_EFFECTS:
        if name != "wind":  # `_probe_loads` has it
            yield Probe(name, moving, _with_effect(moving, name, {}), _differs)
    for setting, part in PARTS.items():
        name, _, key = setting.partition(".")
        kind = DRIVES[drive]
        is_moved = entry.servos if kind.is_servo else not kind.is_prescribed
        if (part.on_axes and not is_moved) or (name == "limits" and not kind.is_servo):
            continue
        numbers = {key: other.none for key, other in EFFECTS[name].parts.items()}
        without = _with_effect(moving, name, numbers)
        with_effect = _with_effect(moving, name, {**numbers, key: part.tried})
        yield Probe(setting, without, with_effect, _differs)


def _with_effect(trial: ProbeRun, name: str, numbers: Mapping[str, float]) -> ProbeRun:
    usual = EFFECTS[name]()
    update = {key: spread(number, getattr(usual, key)) for key, number in numbers.items()}
    return replace(trial, effects=NO_EFFECTS.model_copy(update={name: usual.model_copy(update=update)}))


def _grows(part: int, column: int, expected: float) -> Callable[[Outcome, Outcome], bool]:
    """Return a test that a column of an outcome grows by at least REACTION times `expected`."""

    def reacts(without: Outcome, with_setting: Outcome) -> bool:
        return bool(with_setting[part][column] - without[part][column] > REACTION * expected)

    return reacts


def _differs(without: Outcome, with_setting: Outcome) -> bool:
    return any(not np.array_equal(a, b) for a, b in zip(without, with_setting, strict=True))


def _outcome(entry: PlantEntry, drive: Drive, trial: ProbeRun) -> Outcome:
    """Return state and load after PROBE_PERIODS periods; raise InputError as the plant does."""
    base = RIG.model_copy(update=dict(entry.fixed))
    rig = base.model_copy(
        update={name: factor * getattr(base, name) for name, factor in trial.scaled.items()}
    )
    plant: Any = entry.load()(rig, drive=drive, step=PROBE_PERIOD, substeps=1, effects=trial.effects)
    middle = np.zeros(10)
    middle[0:6:2] = RIG.workspace.mean(axis=1)
    state = getattr(plant, "rest", middle).copy()
    state[ALPHA], state[BETA] = (0.1, 0.05) if trial.swinging else (0.0, 0.0)
    plant.check_length(state[ROPE])
    plant.reset(state)
    command = np.full(3, 0.2 if trial.driven else 0.0)
    if DRIVES[drive].at_rest == "weight":
        command = 10.0 * command
        command[2] -= RIG.weight  # to hold the load
    load = np.zeros(7)
    disturbance, wind = np.array(trial.disturbance), np.array(trial.wind)
    for _ in range(PROBE_PERIODS):
        plant.advance(command, disturbance, wind, load)
    plant.measure(state)
    return state, load
