"""Effects and drives that a plant cannot show are refused before a run, with a remedy that names others."""

import itertools

import pytest

from cranectl.plants.plant import DRIVES
from cranectl.plants.registry import PLANTS
from cranectl.scenario.effects import (
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
from cranectl.support.errors import InputError
from tests.conftest import PLANTS as DEFAULT_PLANTS

NONE = (0.0, 0.0, 0.0)
PIVOT = Friction(coulomb=NONE, viscous=NONE)
SLIDING, STICKING = (
    {"friction": PIVOT.model_copy(update={part: (1.0, 0.0, 0.0)})} for part in ("viscous", "coulomb")
)
UNLIMITED = DriveLimits(force=(DriveLimits.NO_LIMIT,) * 3)
LIMITED = {"limits": DriveLimits(force=(60.0, 40.0, 30.0))}
HEAVY = {"rope": Rope(), "body": Body(), "frame": Frame()}
DEAD_ZONE = Installation(dead_zone=(0.02, 0.03, 0.01))
BOUNDS = " and ".join(
    f"effects.limits.{name} = [1e+09, 1e+09, 1e+09]" for name in ("velocity", "acceleration")
)
NO_ZONE = "take '--drive velocity'; or set effects.installation.dead_zone = [0, 0, 0]"
OTHERS = "take '--plants elastic,mujoco'"
REFUSED = [  # plant, drive, effects, parts of the message
    *[("analytic", "velocity", {name: effect}, [f"[effects.{name}]", OTHERS])
      for name, effect in HEAVY.items()],
    *[("analytic", drive, STICKING, ["effects.friction.coulomb", OTHERS])
      for drive in ("velocity", "force")],
    ("analytic", "velocity", LIMITED, ["effects.limits.force", OTHERS]),
    ("analytic", "force", {"limits": UNLIMITED}, [f"take '--drive velocity'; or set {BOUNDS}"]),
    ("mujoco", "force", LIMITED, ["effects.limits.velocity", "--drive velocity"]),
    *[("analytic", drive, {"installation": DEAD_ZONE}, [f"dead_zone with {drive} drives", NO_ZONE])
      for drive in ("ideal", "force")],
    *[("mujoco", "ideal", friction, ["with ideal drives", "'--drive force'"])
      for friction in (SLIDING, STICKING)],
    *[(plant, "ideal", limits, ["with ideal drives", "--drive velocity"])
      for plant in DEFAULT_PLANTS for limits in (LIMITED, {"limits": UNLIMITED})],
    ("drake", "velocity", {"rope": Rope()}, ["[effects.rope] on the Drake", "the elastic or MuJoCo plant"]),
    ("drake", "velocity", LIMITED, ["limits.force on the Drake plant", "MuJoCo plant with velocity"]),
    ("drake", "velocity", STICKING, ["friction.coulomb on the Drake plant", "MuJoCo plant with velocity"]),
    ("drake", "velocity", {"friction": PIVOT}, ["pivot_coulomb on", "the analytic or elastic or MuJoCo"]),
]  # fmt: skip


@pytest.mark.parametrize(("plant", "drive", "effects", "parts"), REFUSED)
def test_what_a_plant_or_its_drives_cannot_show_is_refused(
    plant: str, drive: str, effects: dict[str, object], parts: list[str]
) -> None:
    with pytest.raises(InputError) as caught:
        PLANTS.entry(plant).check_effects(EffectSettings(**effects), drive)
    assert all(part in str(caught.value) for part in parts)


@pytest.mark.parametrize(("plant", "drive"), list(itertools.product(DEFAULT_PLANTS, DRIVES)))
def test_effects_that_suit_every_plant_are_accepted(plant: str, drive: str) -> None:
    velocity = {"limits": UNLIMITED, "installation": DEAD_ZONE} if drive == "velocity" else {}
    heavy = HEAVY if plant != "analytic" else {}
    effects = EffectSettings(
        friction=PIVOT, wind=Wind(), sensing=Sensing(), delay=Delay(), **velocity, **heavy
    )
    PLANTS.entry(plant).check_effects(effects, drive)
    if plant != "analytic" and drive == "velocity":
        PLANTS.entry(plant).check_effects(EffectSettings(friction=Friction(), limits=DriveLimits()), drive)
