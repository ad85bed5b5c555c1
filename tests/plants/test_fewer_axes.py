"""Cranes with fewer axes: planar ones, and ropes of fixed length, against Newton's equations of a crane."""

import functools
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl import open_run
from cranectl.cases import Case
from cranectl.planning import load_scenario
from cranectl.plants.plant import DRIVES
from cranectl.scenario.effects import Body, EffectSettings, Frame, Friction, Rope
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run, RunKind, simulate_run
from cranectl.status import RunStatus
from cranectl.support import InputError
from tests.conftest import PLANTS
from tests.plants.cranes import make, simulate

FIXED = [("x", "fixed"), ("y", "fixed"), ("x", "hoisted"), ("y", "hoisted"), ("xy", "fixed")]
LENGTH, PERIODS = 0.8, 1000


def rig_of(axes: str, rope: str) -> RigParameters:
    table = {"axes": axes, "rope": rope, "load_mass": 1.7, "bridge_mass": 4.0}
    return RigParameters.from_table(table, "a rig")


class NewtonCrane:
    """A load on a massless rope from a pivot on rails: Newton's equations, in Cartesian coordinates.

    The state has the pivot (x, y), the rope's length, the load (x, y, z), and their rates.
    """

    def __init__(self, rig: RigParameters, drive: str) -> None:
        self.rig, self.drive = rig, drive
        self.moves = np.array(["x" in rig.axes, "y" in rig.axes, rig.rope == "hoisted"])
        self.masses = np.array([rig.bridge_mass + rig.trolley_mass, rig.trolley_mass, rig.winch_mass])
        lags = [rig.bridge_time_constant, rig.trolley_time_constant, rig.winch_time_constant]
        self.gain = (self.masses + np.array([0.0, 0.0, rig.load_mass])) / lags

    def rates(self, _: float, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        place, rate = state[:6], state[6:]
        mass, gravity = self.rig.load_mass, np.array([0.0, 0.0, -self.rig.gravity])
        force = command
        if self.drive == "velocity":
            force = self.gain * (command - rate[:3]) - [0.0, 0.0, mass * self.rig.gravity]
        away = place[3:] - [place[0], place[1], 0.0]
        length = np.linalg.norm(away)
        n = away / length
        relative = rate[3:] - [rate[0], rate[1], 0.0]
        turning = (relative @ relative - (relative @ n) ** 2) / length
        pulled = np.array([n[0], n[1], 1.0]) * self.moves / self.masses  # accelerations per tension
        free = force * self.moves / self.masses
        # Along the rope: n·(load - pivot)'' + turning = l'', of which the tension is a part.
        gap = n @ gravity - n[:2] @ free[:2] + turning - free[2]
        tension = gap / (1.0 / mass + n[:2] @ pulled[:2] + pulled[2])
        return np.concatenate([rate, free + tension * pulled, gravity - tension / mass * n])

    def run(self, commands: np.ndarray) -> np.ndarray:
        """Return pivot, rope and load (N, 6) at the start of each period of 1 ms; it begins at rest."""
        state = np.array([1.0, 0.7, LENGTH, 1.0, 0.7, -LENGTH, *np.zeros(6)])
        places = np.zeros((len(commands), 6))
        for k, command in enumerate(commands):
            places[k] = state[:6]
            solved = solve_ivp(
                self.rates, (0.0, 1e-3), state, method="DOP853", args=(command,), rtol=1e-12, atol=1e-13
            )
            state = solved.y[:, -1]
        return places


@functools.cache
def newton_places(axes: str, rope: str, drive: str) -> np.ndarray:
    rig = rig_of(axes, rope)
    return NewtonCrane(rig, drive).run(commands(drive, rig))


def commands(drive: str, rig: RigParameters) -> np.ndarray:
    """Return commands (PERIODS, 3) that swing the load, also for axes that do not move."""
    time = 1e-3 * np.arange(PERIODS)[:, None]
    waves = np.sin(time * [3.0, 4.0, 5.0] + [0.0, 0.5, 0.0])
    if drive == "velocity":
        return waves * [0.5, 0.4, 0.1]
    return waves * [8.0, 6.0, 1.5] - [0.0, 0.0, rig.load_mass * rig.gravity]


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("drive", ["velocity", "force"])
@pytest.mark.parametrize(("axes", "rope"), FIXED)
def test_planar_cranes_and_fixed_ropes_obey_newton(axes: str, rope: str, drive: Any, plant: str) -> None:
    rig = rig_of(axes, rope)
    given = commands(drive, rig)
    expected = newton_places(axes, rope, drive)
    start = np.array([1.0, 0, 0.7, 0, LENGTH, 0, 0, 0, 0, 0])
    states, loads = simulate(make(plant, drive=drive, rig=rig, start=start), PERIODS, lambda k: given[k])
    assert np.ptp(expected[:, 3:], axis=0).max() > 0.03, "nothing swings"
    np.testing.assert_allclose(loads[:, :3], expected[:, 3:], rtol=0, atol=1e-8)
    np.testing.assert_allclose(states[:, 0:6:2], expected[:, :3], rtol=0, atol=1e-8)
    for axis, moves in enumerate(NewtonCrane(rig, drive).moves):
        if not moves:
            assert np.ptp(states[:, 2 * axis]) < 1e-11


EFFECTS = [
    EffectSettings(rope=Rope()),
    EffectSettings(body=Body()),
    EffectSettings(friction=Friction()),
    EffectSettings(frame=Frame()),
]


@pytest.mark.parametrize("drive", ["ideal", "velocity", "force"])
@pytest.mark.parametrize("effects", EFFECTS, ids=lambda effects: effects.names[0])
def test_plants_agree_on_fewer_axes_with_effects(effects: EffectSettings, drive: Any) -> None:
    """Friction that sticks is a soft constraint in MuJoCo."""
    rig = rig_of("x", "fixed")
    given = np.zeros((800, 3)) if drive == "ideal" else commands(drive, rig)[:800]
    if drive == "ideal":
        given[:, 0] = 2.0 * np.sin(0.005 * np.arange(800))
    steps: Any = {"drive": drive, "rig": rig, "step": 2.5e-4, "substeps": 4}
    loads = [
        simulate(make(plant, effects, **steps), len(given), lambda k: given[k])[1]
        for plant in ("elastic", "mujoco")
    ]
    limit = 1e-7 if effects.friction else 1e-9
    assert np.ptp(loads[0][:, 0]) > 0.02, "nothing moves"
    np.testing.assert_allclose(loads[0][:, :3], loads[1][:, :3], rtol=0, atol=limit)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(
    ("controller", "rope"),
    [("lqr-integral", "fixed"), ("pid", "fixed"), ("lqr", "hoisted"), ("pid", "hoisted")],
)
def test_plants_agree_in_closed_loop(controller: str, rope: str, drive: Any) -> None:
    scenario = load_scenario("cart-transfer", overrides=[f"rig.rope={rope}", "duration=7.0"])
    result = Case.of(scenario, controller=controller, drive=drive, keep="none", pairwise=True).run()
    assert result.passed
    for pair in result.pairs:
        assert max(pair.agreement.max_load_error_m, pair.agreement.max_angle_error_rad) < 1e-8


def test_commands_for_fixed_axes_are_ignored() -> None:
    """Also those of a program that steps the crane, and of a controller for all axes."""
    scenario = load_scenario("cart-transfer", overrides=["disturbances=[]"])
    crane = open_run(scenario, plant="mujoco", drive="velocity")
    state = crane.step([0.1, 0.3, -0.2], samples=1000)
    assert state[0] > 0.25
    np.testing.assert_allclose(state[2:6], [0.0, 0.0, 0.4, 0.0], rtol=0, atol=3e-13)
    run = simulate_run(scenario, plant="analytic", drive="force", controller="pid")
    np.testing.assert_array_equal(run.commands[:, 1:], 0.0)
    np.testing.assert_array_equal(run.state.axes[:, 1], 0.0)


def line(x: float, y: float, z: float, seconds: float) -> str:
    return f"reference.segments=[{{kind='line',to=[{x},{y},{z}],duration={seconds}}}]"


def load_and_run(overrides: list[str]) -> Run:
    scenario = load_scenario("cart-transfer", overrides=overrides)
    return simulate_run(scenario, plant="analytic", controller=scenario.controller.name)


HOISTED, ALL_AXES = "rig.rope='hoisted'", "rig.axes='xy'"
REFUSED = {  # what is refused, its remedy, and what follows it
    "across": (["initial.load_offset=[0,0.01,0]"], "set initial.load_offset.1 to 0", []),
    "swing": (["initial.alpha_offset=0.1"], "or rig.axes to 'xy'", ["initial.alpha_offset=0.1", ALL_AXES]),
    "longer": (["initial.load_offset=[0,0,-0.01]"], "set initial.load_offset.2 to 0", []),
    "push": (["disturbances=[{force=[0,1,0],start=1.0}]"], "set disturbances.0.force.1 to 0", []),
    "turn": (["disturbances=[{joint='alpha',magnitude=1,start=1.0}]"], "disturbances.0.magnitude to 0", []),
    "wind": (["effects.wind.mean=[1,2,0]"], "set effects.wind.mean.1 to 0", ["effects.wind.mean=[1,0,0]"]),
    "slope": (["effects.installation.tilt=[0,0.01]"], "set effects.installation.tilt.1 to 0", []),
    "aside": ([line(1.0, 0.1, -0.4, 3.0)], "give all points this y", [line(1.0, 0.0, -0.4, 9.0)]),
    "flat": (["controller='lqr'"], "or set rig.rope to 'hoisted'", ["controller='lqr'", HOISTED]),
    "flat too": (["controller='flat-velocity'"], "take lqr-integral, pid", ["controller='pid'"]),
    "hoist": ([line(1.0, 0.0, -0.5, 3.0)], "give points of one height, and kind = 'move'", []),
    "straight": ([line(1.0, 0.0, -0.4, 1.5)], "kind = 'move'", []),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_fixed_axis_cannot_do_is_refused(name: str) -> None:
    """What its remedy says runs."""
    overrides, remedy, followed = REFUSED[name]
    with pytest.raises(InputError) as caught:
        load_and_run(overrides)
    assert remedy in caught.value.remedy
    assert load_and_run(followed).status == RunStatus.COMPLETED


@pytest.mark.parametrize("place", [3, 5, 6, 7])
def test_a_start_across_the_plane_is_refused(place: int) -> None:
    crane = open_run(load_scenario("cart-transfer"), plant="analytic")
    state = np.array([0.3, 0, 0, 0, 0.4, 0, 0, 0, 0.1, 0.2])
    crane.reset(state)
    state[place] = 0.1
    with pytest.raises(InputError, match=r"rig\.axes = 'x'"):
        crane.reset(state)


def test_gusts_blow_in_the_plane_only() -> None:
    scenario = load_scenario("cart-transfer", overrides=["effects.wind={gust=1.0}", "reference.segments=[]"])
    air = scenario.air_velocity(1000)
    assert np.ptp(air[:, 0]) > 0.1
    assert not air[:, 1:].any()
    run = simulate_run(scenario, plant="elastic", controller="lqr-integral")
    assert not run.state.angles[:, 0].any()


@pytest.mark.parametrize("drive", DRIVES)
def test_a_fixed_rope_stays_as_long_as_it_was_for_ten_minutes(drive: Any) -> None:
    """On MuJoCo a rotor holds it; on the other plants its equation is left out."""
    overrides = ["control.period=0.01", "control.physics_step=0.01", "rig.load_mass=2.0"]
    scenario = load_scenario("cart-transfer", overrides=[*overrides, "reference.segments=[]"])
    state = open_run(scenario, plant="mujoco", drive=drive).step([0.0, 0.0, 0.0], samples=60_000)
    assert abs(state[4] - 0.4) < 1e-9


OF_FIXED_AXES = {
    "rig.winch_mass": ("rig.winch_mass=0.3", "rope"),
    "rig.winch_time_constant": ("rig.winch_time_constant=0.3", "rope"),
    "rig.trolley_time_constant": ("rig.trolley_time_constant=0.3", "trolley"),
    "effects.limits.velocity.2": ("effects.limits.velocity=[0.5,0.5,0.01]", "rope"),
    "effects.friction.coulomb.1": ("effects.friction.coulomb=[0.4,5.0,0.2]", "trolley"),
    "effects.installation.dead_zone.2": ("effects.installation.dead_zone=[0,0,0.1]", "rope"),
}
USUAL = [
    "reference.segments=[]", "duration=1.0", "initial.beta_offset=0.1", "disturbances=[]",
    "effects.limits.velocity=[0.5,0.5,0.5]", "effects.friction.coulomb=[0.4,0.2,0.2]",
    "effects.installation={}",
]  # fmt: skip


@pytest.mark.parametrize("name", OF_FIXED_AXES)
def test_numbers_of_fixed_axes_change_nothing_and_are_told(name: str) -> None:
    override, axis = OF_FIXED_AXES[name]
    usual, changed = (load_scenario("cart-transfer", overrides=[*USUAL, *more]) for more in ((), (override,)))
    one, other = (
        simulate_run(scenario, plant="elastic", drive="velocity", controller="pid").table
        for scenario in (usual, changed)
    )
    np.testing.assert_array_equal(one, other)
    kind = RunKind("elastic", "velocity", "pid")
    assert RunKind.find_idle_settings(changed, changed, [name], [kind]) == {
        f"the {axis} does not move": [name]
    }
