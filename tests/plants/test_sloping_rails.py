"""The analytic plant on rails that slope: closed forms of what gravity does to its load."""

import numpy as np
import pytest

from cranectl.plants.analytic import AnalyticPlant, derivative, observe_load
from cranectl.plants.surroundings import gravity_in_rig
from cranectl.scenario.effects import EffectSettings, Installation
from cranectl.scenario.rig import RigParameters

RIG = RigParameters(load_mass=1.7)
SLOPING = EffectSettings(installation=Installation(tilt=(0.12, -0.07)))
PULL = np.array(gravity_in_rig(RIG.gravity, SLOPING))
STILL = np.zeros(6)


def plant() -> AnalyticPlant:
    return AnalyticPlant(RIG, drive="ideal", step=1e-3, substeps=1, effects=SLOPING)


def at_rest(alpha: float, beta: float) -> np.ndarray:
    return np.array([1.0, 0.0, 0.7, 0.0, 0.8, 0.0, alpha, 0.0, beta, 0.0])


def test_the_load_hangs_along_gravity_with_its_weight() -> None:
    n = PULL / np.linalg.norm(PULL)
    state = at_rest(np.arctan2(n[1], -n[2]), np.arcsin(n[0]))
    assert np.abs(state[[6, 8]]).min() > 0.05
    rate, load = np.zeros(10), np.zeros(7)
    derivative(plant().rig, state, STILL, np.zeros(2), STILL, rate)
    assert rate == pytest.approx(np.zeros(10), abs=1e-14)
    observe_load(plant().rig, state, STILL, STILL, load)
    assert load[6] == pytest.approx(RIG.weight, rel=1e-14)


@pytest.mark.parametrize(("alpha", "beta"), [(0.0, 0.0), (0.3, -0.2), (-0.4, 0.5)])
def test_elsewhere_it_falls_towards_gravity(alpha: float, beta: float) -> None:
    """l beta'' = g . t_beta and l cos(beta) alpha'' = g . t_alpha at rest; the tension is what is left."""
    state, rate, load = at_rest(alpha, beta), np.zeros(10), np.zeros(7)
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    derivative(plant().rig, state, STILL, np.zeros(2), STILL, rate)
    assert rate[7] == pytest.approx(PULL @ [0.0, ca, sa] / (0.8 * cb), rel=1e-13)
    assert rate[9] == pytest.approx(PULL @ [cb, -sb * sa, sb * ca] / 0.8, rel=1e-13)
    observe_load(plant().rig, state, STILL, STILL, load)
    assert load[6] == pytest.approx(RIG.load_mass * PULL @ [sb, cb * sa, -ca * cb], rel=1e-13)
