"""A scenario with other effects than its own."""

from collections.abc import Iterable
from typing import NamedTuple

from cranectl.effects.settings import (
    ALL_EFFECTS,
    Body,
    Delay,
    DriveLimits,
    EffectSettings,
    Frame,
    Friction,
    Installation,
    Rope,
    Sensing,
    Wind,
)
from cranectl.scenario import Scenario
from cranectl.settings import parse_settings


class AssumedEffects(NamedTuple):
    """Settings of every effect."""

    limits: DriveLimits
    sensing: Sensing
    delay: Delay
    friction: Friction
    rope: Rope
    body: Body
    wind: Wind
    frame: Frame
    installation: Installation

    def only(self, *names: str) -> EffectSettings:
        """The effects of these names and no others."""
        return EffectSettings(**{name: getattr(self, name) for name in names})


def assumed_effects(scenario: Scenario) -> AssumedEffects:
    """The scenario's own settings of each effect, else the defaults."""
    names = AssumedEffects._fields
    return AssumedEffects(*(getattr(scenario.effects, n) or getattr(ALL_EFFECTS, n) for n in names))


def replace_effects(scenario: Scenario, effects: EffectSettings) -> Scenario:
    """`scenario` with exactly these effects; raises InputError where its other settings forbid them."""
    table = {
        **scenario.model_dump(mode="json"),
        "effects": {name: getattr(effects, name).model_dump(mode="json") for name in effects.names},
    }
    return parse_settings(Scenario, table, f"{scenario.name} with {', '.join(effects.names) or 'no effects'}")


def with_effects(scenario: Scenario, names: Iterable[str]) -> Scenario:
    """`scenario` with exactly the effects of these names, as assumed for it."""
    return replace_effects(scenario, assumed_effects(scenario).only(*names))
