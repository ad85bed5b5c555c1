"""The elastic plant against the engine: effect by effect, drive by drive, open loop."""

import numpy as np
import pytest

from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import NO_EFFECTS, EffectNumbers, EffectSettings
from cranectl.support.arrays import Array
from tests.conftest import STILL
from tests.plants.cranes import RIG, make, simulate

NUMBERS = EffectNumbers()
TILTED = NUMBERS.installation.model_copy(update={"tilt": (0.03, -0.05)})
START = np.array([1.0, 0.1, 0.7, -0.2, 0.8, 0.05, 0.1, 0.4, -0.15, -0.3])
WIND = np.array([1.5, -0.9, 0.3, 0.2, -0.1, 0.3])
AMPLITUDE, FREQUENCY = np.array([0.4, 0.3, 0.2]), np.array([3.0, 4.0, 2.0])

# Largest differences of angles [rad] and load [m] over 0.8 s of motion in all axes. Both schemes err by less
# than EXACT. The engine holds the rope's stiffness and mass over a step, and drag from its start; the hook
# from which it hangs a body weighs a billionth of the load; its friction is of first order in the step.
EXACT, HOOK, ROPE, LATE, FIRST = 1e-9, 4e-9, 2e-8, 1e-5, 3e-4
CASES = [
    ((), (0.0, 0.0), EXACT), ((), (0.5, -0.4), EXACT), (("frame",), (0.5, -0.4), EXACT),
    (("installation",), (0.0, 0.0), EXACT), (("frame", "installation"), (0.0, 0.0), EXACT),
    (("rope",), (0.5, -0.4), ROPE), (("body",), (0.5, -0.4), HOOK), (("wind",), (0.0, 0.0), LATE),
    (("friction",), (0.0, 0.0), FIRST),
    (("rope", "body", "wind", "frame", "installation"), (0.5, -0.4), LATE),
]  # fmt: skip


def chosen(*names: str) -> EffectSettings:
    """Return effects with the laboratory's numbers, on rails that slope."""
    return NUMBERS.model_copy(update={"installation": TILTED}).only(*names)


def command(drive: Drive, k: int) -> Array:
    """Return the command of sample `k`: oscillating speeds, or the accelerations or forces for them."""
    phase = FREQUENCY * 1e-3 * k + np.array([0.0, 0.3, 0.0])
    if drive == "velocity":
        return AMPLITUDE * np.sin(phase)
    accelerations = AMPLITUDE * FREQUENCY * np.cos(phase)
    return accelerations if drive == "ideal" else accelerations * RIG.driven_masses - [0.0, 0.0, RIG.weight]


def moved(
    drive: Drive,
    effects: EffectSettings,
    disturbance: tuple[float, float],
    believed: EffectSettings | None = None,
    substeps: int = 1,
) -> tuple[float, float]:
    """Return the largest difference of angles and load over a motion, and the least travel of a joint.

    The elastic plant has the effects `believed`, the engine `effects`.
    """
    runs = []
    for name, shown in (("elastic", believed or effects), ("mujoco", effects)):
        plant = make(name, shown, drive=drive, step=1e-3 / substeps, substeps=substeps, start=START)
        air = WIND if effects.wind else STILL
        runs.append(simulate(plant, 800, lambda k: command(drive, k), disturbance, air))
    (a, loads_a), (b, loads_b) = runs
    difference = max(np.abs(a - b)[:, ::2].max(), np.abs(loads_a - loads_b)[:, :3].max())
    return difference, np.abs(a - START)[:, ::2].min(axis=1).max()


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(("names", "disturbance", "limit"), CASES)
def test_it_moves_as_the_engine_does(
    names: tuple[str, ...], disturbance: tuple[float, float], limit: float, drive: Drive
) -> None:
    difference, way = moved(drive, chosen(*names), disturbance)
    assert difference < limit
    assert way > 0.002
    if names == ("friction",):  # which sticks in the engine's way: half the step, half the difference
        assert moved(drive, chosen(*names), disturbance, substeps=4)[0] < 0.35 * difference


@pytest.mark.parametrize(
    ("effect", "changed"),
    [
        ("rope", {"stiffness": 4.9e4}), ("rope", {"mass": 0.0031}), ("rope", {"damping_ratio": 0.11}),
        ("body", {"inertia": 1.001e-3}), ("body", {"hook_offset": 0.0601}),
        ("body", {"swing_damping": 1.1e-3}),
        ("wind", {"drag_area": 0.0042}), ("frame", {"mass": 20.1}), ("frame", {"frequency": (9.01, 12.0)}),
        ("frame", {"frequency": (9.0, 12.01)}), ("frame", {"damping_ratio": 0.0201}),
        ("installation", {"tilt": (0.0301, -0.05)}), ("installation", {"tilt": (0.03, -0.0501)}),
        ("friction", {"viscous": (5.0, 2.0, 2.0)}), ("friction", {"viscous": (4.0, 3.0, 2.0)}),
        ("friction", {"viscous": (4.0, 2.0, 9.0)}), ("friction", {"coulomb": (2.1, 1.0, 1.0)}),
        ("friction", {"coulomb": (2.0, 1.1, 1.0)}), ("friction", {"coulomb": (2.0, 1.0, 1.3)}),
        ("friction", {"pivot_coulomb": 3e-3}), ("friction", {"pivot_viscous": 1e-2}),
    ],
)  # fmt: skip
def test_another_crane_moves_otherwise(effect: str, changed: dict[str, object]) -> None:
    """A change of any constant by some per cent exceeds the limits above."""
    effects = chosen(effect)
    other = effects.model_copy(update={effect: getattr(effects, effect).model_copy(update=changed)})
    limit = {"wind": LATE, "body": HOOK, "rope": ROPE, "friction": FIRST}.get(effect, EXACT)
    assert moved("force", effects, (0.0, 0.0), other)[0] > 1.5 * limit


def test_forces_are_limited_alike() -> None:
    limits = NUMBERS.limits.model_copy(update={"force": (8.0, 2.5, 10.0)})
    effects = NO_EFFECTS.model_copy(update={"limits": limits})
    for drive in ("velocity", "force"):
        assert moved(drive, effects, (0.0, 0.0))[0] < 2e-6  # where a force is cut off schemes are of order 2
        assert moved(drive, effects, (0.0, 0.0), NO_EFFECTS)[0] > 1e-3
