"""What runs leave out of the model changes no bit of them, under any effect, and makes them faster."""

import itertools

import mujoco
import numpy as np
import pytest

from cranectl.plants.mujoco import plant as plant_module
from cranectl.plants.mujoco.geometry import draw_to_scale
from cranectl.plants.mujoco.model import compiled_model, model_description, model_spec
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import NO_EFFECTS, Body, DriveLimits, EffectSettings, Frame, Friction, Rope
from cranectl.scenario.rig import RigParameters
from tests.plants.cranes import RIG, make, simulate

START = np.array([1.0, 0.0, 0.7, 0.0, 0.7, 0.0, 0.2, 0.3, -0.3, 0.1])
PHYSICAL = {
    "limits": DriveLimits(force=(200.0, 100.0, 60.0)),
    "friction": Friction(),
    "rope": Rope(),
    "body": Body(),
    "frame": Frame(),
}
SETS = [names for count in (0, 1, 2, 5) for names in itertools.combinations(PHYSICAL, count)]


def course(drive: Drive, effects: EffectSettings) -> np.ndarray:
    """States and loads of a crane that moves all its joints."""
    step, wind = 1e-4 if effects.rope else 1e-3, np.array([3.0, 1.0, 0.0, 0.3, 0.2, 0.1])
    plant = make("mujoco", effects, drive=drive, step=step, substeps=5, start=START)

    def command(period: int) -> np.ndarray:
        return np.array([0.2, -0.15, 0.1]) * np.sin(0.1 * period)

    return np.hstack(simulate(plant, 100, command, (1.0, -2.0), wind))


def drawn_model(rig: RigParameters, drive: Drive, step: float, effects: EffectSettings) -> mujoco.MjModel:
    """Drawn large, which is to change nothing either."""
    spec = model_spec(rig, drive=drive, step=step, effects=effects)
    draw_to_scale(spec, rig.model_copy(update={"bridge_range": (0.0, 40.0), "rope_range": (2.0, 45.0)}))
    return spec.compile()


@pytest.mark.parametrize("names", SETS, ids="+".join)
@pytest.mark.parametrize("drive", DRIVES)
def test_runs_are_those_of_the_model_as_drawn(
    drive: Drive, names: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    effects = EffectSettings(**{name: PHYSICAL[name] for name in names})
    lean = course(drive, effects)
    monkeypatch.setattr(plant_module, "compiled_model", drawn_model)
    drawn = course(drive, effects)
    assert np.isfinite(lean).all()
    assert np.ptp(lean[:, 8]) > 1e-3
    assert (lean == drawn).all()


def test_nothing_that_is_drawn_is_left_in_the_model_of_a_run() -> None:
    model = compiled_model(RIG, "velocity", 1e-3, NO_EFFECTS)
    drawn = model_description(RIG, "velocity", 1e-3, NO_EFFECTS)
    assert (model.ngeom, model.ncam, model.nlight, model.ntendon, model.nmat, model.ntex) == (0,) * 6
    assert model.nsensor == 3, "load position, load velocity, rope force"
    assert 'geom name="load_ball"' in drawn, "the description of a run shows the crane"


def test_the_engine_does_not_look_at_a_clock() -> None:
    """Its timers, which cost a quarter of a step, stay at zero."""
    plant = make("mujoco")
    mujoco.mj_step(plant.model, plant.data, 100)
    timer = plant.data.timer[mujoco.mjtTimer.mjTIMER_STEP]
    assert timer.number >= 100
    assert timer.duration == 0.0
