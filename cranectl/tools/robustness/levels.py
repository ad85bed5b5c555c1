"""Define the fidelity levels, from theory to the real rig, and give a scenario other effects."""

from collections.abc import Iterable
from dataclasses import dataclass

from cranectl.plants import Drive
from cranectl.scenario import EFFECTS, NANOSECONDS, EffectNumbers, EffectSettings, Scenario, nanoseconds


@dataclass(frozen=True)
class Level:
    """A level of fidelity: its addition to the level before, its plant and its drives."""

    name: str
    adds: str
    plant: str = "mujoco"  # the plant that simulates its physics
    drive: Drive = "velocity"


LEVELS = (
    Level("continuous", "theory: nothing sampled, ideal drives", "analytic", "ideal"),
    Level("sampled", "control at the control period, inputs held", "analytic", "ideal"),
    Level("engine", "the physics engine in place of the equations", "mujoco", "ideal"),
    Level("servos", "velocity servos of finite bandwidth that feel the load"),
    *(Level(name, kind.adds) for name, kind in EFFECTS.items() if kind.adds),
)
NAMES = tuple(level.name for level in LEVELS)
EFFECT_LEVELS = tuple(name for name, kind in EFFECTS.items() if kind.adds)
BASE = "servos"  # the level to which a single effect is added
MODEL = "model"  # the last level, of the model file that a rig names


def assumed_effects(scenario: Scenario) -> EffectNumbers:
    """Return the settings of every effect: the scenario's, else the rig's with a delay of whole periods."""
    effects, numbers = scenario.effects, scenario.rig.effects
    if not effects.delay:
        periods = -(-nanoseconds(numbers.delay.seconds) // scenario.period_ns)
        delay = numbers.delay.with_numbers({"seconds": periods * scenario.period_ns / NANOSECONDS})
        numbers = numbers.model_copy(update={"delay": delay})
    return numbers.model_copy(update={name: getattr(effects, name) for name in effects.names})


def replace_effects(scenario: Scenario, effects: EffectSettings) -> Scenario:
    """Return `scenario` with exactly these effects; raise InputError if its settings forbid them."""
    scenario.rig.check_size(effects)
    table = {
        **scenario.model_dump(mode="json"),
        "effects": {name: getattr(effects, name).model_dump(mode="json") for name in effects.names},
    }
    added = Scenario.from_table(table, f"{scenario.name} with {', '.join(effects.names) or 'no effects'}")
    return added.with_files(scenario.held_files)


def with_effects(scenario: Scenario, names: Iterable[str]) -> Scenario:
    """Return `scenario` with exactly the effects of these names, with the settings of `assumed_effects`."""
    return replace_effects(scenario, assumed_effects(scenario).only(*names))
