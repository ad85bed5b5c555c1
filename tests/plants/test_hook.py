"""The mass of the hook: weight and modes in closed form, and plants that agree in closed loop."""

import re

import numpy as np
import pytest
from scipy.linalg import eigh

from cranectl.planning import load_scenario
from cranectl.plants.elastic.plant import ElasticPlant
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import Body, EffectSettings, Rope
from cranectl.simulate import simulate_run
from tests.conftest import ROOT
from tests.plants.cranes import HANGING, RIG, assert_runs_agree, make, simulate

HOOK = Body(hook_offset=0.3, inertia=2e-3, swing_damping=0.0, hook_mass=0.4)
NAMES = ("elastic", "mujoco")
CASES = [
    (share, drive, *case)
    for share, case in zip(
        (0.01, 0.1, 0.3, 1.0),
        (("fast-diagonal", "lqr+hinf"), ("near-slack", "lqr"), ("settled-trajectory", "pid"),
         ("fixed-position", "pole-placement+loop-shaping")),
        strict=True,
    )
    for drive in DRIVES
]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_rope_that_gives_bears_and_damps_both(name: str) -> None:
    rope, hanging = Rope(stiffness=500.0, mass=0.0, damping_ratio=0.1), HANGING[4] - HOOK.hook_offset
    plant = make(name, EffectSettings(body=HOOK, rope=rope), drive="velocity")
    _, loads = simulate(plant, 100)
    assert loads[:, 6] == pytest.approx(1.4 * RIG.gravity, rel=1e-9)
    stretch = -loads[0, 2] - HANGING[4]
    assert stretch == pytest.approx(1.4 * RIG.gravity * hanging / rope.stiffness, rel=1e-9)
    views = plant.crane if isinstance(plant, ElasticPlant) else plant.handle.rope
    assert views.viscosity[0] == pytest.approx(2.0 * 0.1 * np.sqrt(rope.stiffness * 1.4 * hanging), rel=1e-12)


def documented(symbol: str, **values: float) -> float:
    """Return what the page on effects gives for `symbol`; `values` are those of its letters."""
    page = (ROOT / "docs/explanation/effects.md").read_text(encoding="utf-8")
    (formula,) = re.findall(rf" {symbol} = (2 d .*)$", page, re.MULTILINE)
    product = re.sub(r"(?<=[\w)]) (?=[\w(√])", " * ", formula).replace("√", "sqrt").replace("₀", "0")
    return float(eval(product, {"sqrt": np.sqrt, **values}))


@pytest.mark.parametrize("hook", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("name", NAMES)
def test_the_rope_damps_as_the_page_says(name: str, hook: float) -> None:
    """The winch jerks the load. Two samples predict the next, and the poles tell stiffness and damping."""
    body = HOOK.model_copy(update={"hook_mass": hook})
    rope, hanging = Rope(stiffness=500.0, mass=0.0, damping_ratio=0.1), HANGING[4] - HOOK.hook_offset
    plant, step = make(name, EffectSettings(body=body, rope=rope)), 1e-3
    simulate(plant, 6, command=lambda k: (0.0, 0.0, 10.0 if k < 3 else -10.0))
    _, loads = simulate(plant, 600)
    height = loads[::10, 2]
    before = np.column_stack([height[1:-1], height[:-2], np.ones(len(height) - 2)])
    (first, second, _), *_ = np.linalg.lstsq(before, height[2:], rcond=None)
    pole = np.log(np.roots([1.0, -first, -second]).astype(complex)[0]) / (10.0 * step)
    both, stiffness = RIG.load_mass + hook, rope.stiffness / hanging
    assert abs(pole) ** 2 * both == pytest.approx(stiffness, rel=1e-3)
    damping = documented("C₀", d=rope.damping_ratio, K0=stiffness, m=RIG.load_mass, m_h=hook)
    assert -2.0 * pole.real * both == pytest.approx(damping, rel=1e-3)


@pytest.mark.parametrize("axis", range(2))
@pytest.mark.parametrize("name", NAMES)
def test_it_swings_as_a_double_pendulum(name: str, axis: int) -> None:
    """Rope and body start in one line aside; both modes of the planar double pendulum follow."""
    m, d, rope = RIG.load_mass, HOOK.hook_offset, HANGING[4] - HOOK.hook_offset
    both = m + HOOK.hook_mass
    mass = np.array([[both * rope**2, m * rope * d], [m * rope * d, m * d**2 + HOOK.inertia]])
    squares, modes = eigh(np.diag([both * RIG.gravity * rope, m * RIG.gravity * d]), mass)
    aside, time = 1e-5, 1e-3 * np.arange(2000)
    angles = (modes * (modes.T @ mass @ [aside, aside])) @ np.cos(np.sqrt(squares)[:, None] * time)
    start = HANGING + aside * np.eye(10)[6 + 2 * axis]
    states, loads = simulate(make(name, EffectSettings(body=HOOK), start=start), 2000)
    assert np.abs(states[:, 6 + 2 * axis] - angles[0]).max() < 1e-6 * aside
    at = loads[:, 1 - axis] - HANGING[2 - 2 * axis]
    assert np.abs(at - [rope, d] @ angles).max() < 1e-6 * aside
    assert np.abs(angles[0] - angles[1]).max() > 0.2 * aside, "both modes must move"


def assert_agree(a: str, b: str, share: float, drive: Drive, name: str, controller: str, *more: str) -> None:
    """Check agreement to 1e-7 m and rad, and that the hook makes more than a rounding difference."""
    hooked = f"effects.body={{hook_mass={share * RIG.load_mass}}}"
    first, second, other = (
        simulate_run(
            load_scenario(name, overrides=[body, *more]), plant=plant, controller=controller, drive=drive
        )
        for plant, body in ((a, hooked), (b, hooked), ("elastic", "effects.body={}"))
    )
    assert_runs_agree(first, second)
    together = min(len(first.tension), len(other.tension))
    assert np.abs(first.tension[:together] - other.tension[:together]).max() > 0.5 * share * RIG.weight


@pytest.mark.parametrize(("share", "drive", "scenario", "controller"), CASES)
def test_plants_agree_in_closed_loop(share: float, drive: Drive, scenario: str, controller: str) -> None:
    assert_agree(*NAMES, share, drive, scenario, controller)
