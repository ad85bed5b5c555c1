"""Test a plant of another package before its first run: it must react to each setting that it accepts.

If a plant accepted a setting and ignored it, runs would differ in name only. So each setting is changed
alone, over some milliseconds, and the plant must react. For example, a disturbance must accelerate the load,
and a heavier load must raise the tension.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cranectl.plants.capabilities import PARTS, WHOLE_EFFECTS
from cranectl.plants.entry import PlantEntry
from cranectl.plants.plant import DRIVES, Drive
from cranectl.plants.registry import PLANTS
from cranectl.scenario import EFFECTS, EffectNumbers, EffectSettings, ModelNames, RigParameters
from cranectl.signals import ALPHA, BETA, ROPE
from cranectl.support import Array, InputError

PROBE_PERIOD, PROBE_PERIODS = 1e-3, 50  # control period [s], and number of periods
SECONDS = PROBE_PERIOD * PROBE_PERIODS
REACTION = 0.01  # least reaction, as a share of that of a point load on a rigid rope
RIG = RigParameters()
STILL = EffectNumbers().wind.with_numbers({"gust": 0.0})
BREEZE = STILL.with_numbers({"drag_area": 0.02})
AIR = 10.0  # [m/s]
VELOCITY_COLUMN, TENSION_COLUMN = 13, 16  # of an outcome: state (10), load (7) as of `Plant.advance`


@dataclass(frozen=True)
class ProbeRun:
    """A short run: how the plant is made, whether it starts swinging, and what acts on it."""

    scaled: Mapping[str, float] = field(default_factory=dict)  # factors on numbers of the rig, by name
    effects: EffectSettings = EffectSettings()
    moving: bool = False  # whether it starts swinging, and is driven
    disturbance: tuple[float, ...] = (0.0, 0.0)
    wind: tuple[float, ...] = (0.0,) * 6


# A setting, as in `lacks` or as rig.FIELD; two runs that differ in it; how their outcomes must differ.
Probe = tuple[str, ProbeRun, ProbeRun, Callable[[Array, Array], bool]]
REST, MOVING = ProbeRun(), ProbeRun(moving=True)
_tried: dict[tuple[str, Drive], tuple[PlantEntry, tuple[str, ...]]] = {}  # in this process


def check_honest(name: str, drive: Drive) -> None:
    """Raise InputError if a plant ignores a setting that its entry does not exclude."""
    entry = PLANTS.entry(name)
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
    """Return the settings, of those that the entry allows, to which a plant does not react."""
    ignored = dict[str, None]()
    for setting, without, changed, reacts in _probes(entry, drive):
        if entry.why_lacking(setting) is not None or setting.removeprefix("rig.") in entry.fixed:
            continue
        try:
            outcomes = _outcome(entry, drive, without), _outcome(entry, drive, changed)
        except InputError:  # the plant itself refuses the setting
            continue
        without_it, with_it = outcomes
        if without_it is None or with_it is None:  # unstable, which the run itself will report
            continue
        if not reacts(without_it, with_it):
            ignored[setting] = None
    return tuple(ignored)


def _probes(entry: PlantEntry, drive: Drive) -> Iterator[Probe]:
    """Yield the probes of disturbances, wind, numbers of the rig, and effects with their parts."""
    moves = _rig_of(entry).moves
    for disturbance, angle, moved in (((1.0, 0.0), ALPHA, moves[1]), ((0.0, 1.0), BETA, moves[0])):
        if not moved:  # a planar crane does not swing aside
            continue
        pushed = ProbeRun(disturbance=disturbance)
        yield "disturbances", REST, pushed, _grows(angle + 1, 1.0 * SECONDS)
    blow = 0.5 * BREEZE.density * BREEZE.drag_area * AIR**2  # [N]
    for setting, wind, acting, force in (
        ("disturbances.force", STILL, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]), 1.0),
        ("wind", BREEZE, np.array([AIR, 0.0, 0.0, 0.0, 0.0, 0.0]), blow),
    ):
        along = 0 if moves[0] else 1  # x or y
        still = ProbeRun(effects=EffectSettings(wind=wind))
        expected = force / entry.fixed.get("load_mass", RIG.load_mass) * SECONDS
        pushed = replace(still, wind=tuple(np.roll(acting, along)))
        yield setting, still, pushed, _grows(VELOCITY_COLUMN + along, expected)
    for name, factor in (("load_mass", 2.0), ("gravity", 1.5)):
        yield f"rig.{name}", REST, ProbeRun(scaled={name: factor}), _grows(TENSION_COLUMN, RIG.weight)
    kind = DRIVES[drive]
    part = "time_constant" if kind.is_servo else "mass"
    for axis, moved in zip(("bridge", "trolley", "winch"), moves, strict=True):
        if kind.is_prescribed or not moved:
            continue
        name = f"{axis}_{part}"
        yield f"rig.{name}", MOVING, replace(MOVING, scaled={name: 2.0}), _differs
    for name in WHOLE_EFFECTS:
        if name != "wind":
            yield name, MOVING, _with_effect(name, {}), _differs
    is_moved = entry.servos if kind.is_servo else not kind.is_prescribed
    for setting, tried in PARTS.items():
        name, _, key = setting.partition(".")
        if (tried.on_axes and not is_moved) or (name == "limits" and not kind.is_servo):
            continue
        none = {key: other.none for key, other in EFFECTS[name].parts.items()}
        yield setting, _with_effect(name, none), _with_effect(name, {**none, key: tried.tried}), _differs


def _rig_of(entry: PlantEntry) -> RigParameters:
    """Return the rig with what is built into a plant: numbers, and which axes the model of a file has."""
    names = entry.arguments.get("names")
    return RIG.model_copy(update={**entry.fixed, **(names.axes if isinstance(names, ModelNames) else {})})


def _with_effect(name: str, numbers: Mapping[str, float]) -> ProbeRun:
    effect = EFFECTS[name]().with_numbers(numbers)
    return replace(MOVING, effects=EffectSettings().model_copy(update={name: effect}))


def _grows(column: int, expected: float) -> Callable[[Array, Array], bool]:
    """Return a test that a column of an outcome grows by at least REACTION times `expected`."""
    return lambda without, changed: bool(changed[column] - without[column] > REACTION * expected)


def _differs(without: Array, changed: Array) -> bool:
    return not np.array_equal(without, changed)


def _outcome(entry: PlantEntry, drive: Drive, trial: ProbeRun) -> Array | None:
    """Return state and load (17,) after PROBE_PERIODS periods, or None if the plant is unstable.

    Raises InputError as the plant does.
    """
    base = _rig_of(entry)
    rig = base.model_copy(
        update={name: factor * getattr(base, name) for name, factor in trial.scaled.items()}
    )
    plant: Any = entry.load()(rig, drive=drive, step=PROBE_PERIOD, substeps=1, effects=trial.effects)
    middle = np.zeros(10)
    middle[0:6:2] = RIG.workspace.mean(axis=1)
    state = getattr(plant, "rest", middle).copy()
    state[ALPHA], state[BETA] = (0.1 * base.moves[1], 0.05 * base.moves[0]) if trial.moving else (0.0, 0.0)
    plant.reset(state)
    plant.check_length(state[ROPE])
    command = np.full(3, 0.2 if trial.moving else 0.0)
    if DRIVES[drive].at_rest == "weight":
        command = 10.0 * command  # 2 N, where others have 0.2 m/s or m/s²
        command[2] -= RIG.weight  # to hold the load
    load = np.zeros(7)
    disturbance, wind = np.array(trial.disturbance), np.array(trial.wind)
    for _ in range(PROBE_PERIODS):
        plant.advance(command, disturbance, wind, load)
    plant.measure(state)
    outcome = np.concatenate([state, load])
    return None if plant.warnings() or not np.isfinite(outcome).all() else outcome
