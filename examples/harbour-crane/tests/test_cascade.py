"""The cascade on our crane, proven by two models of it that share no equation."""

import pytest

from cranectl import assert_agree, assert_limits

SCENARIO = "../scenarios/ship-to-quay.toml"


@pytest.fixture(scope="module")
def runs(closed_loop):
    """With velocity drives, as the crane has them."""
    return closed_loop(SCENARIO, "cascade", drive="velocity")


@pytest.mark.parametrize("drive", ["ideal", "velocity", "force"])
def test_the_models_can_be_relied_on(closed_loop, drive):
    """They realise the same motion: all that is left is rounding."""
    assert_agree(closed_loop(SCENARIO, "cascade", drive=drive))


def test_the_terminal_gets_what_it_asked_for(runs):
    """By [limits] of the scenario."""
    assert_limits(runs)


@pytest.mark.parametrize("load_mass", [10e3, 30e3])
def test_light_and_heavy_containers(closed_loop, load_mass):
    """The gust moves a light one further, a heavy one pulls the drives more."""
    runs = closed_loop(SCENARIO, "cascade", drive="velocity", overrides=[f"rig.load_mass={load_mass}"])
    assert_limits(runs, max_error_m=1.1)


def test_with_what_a_real_crane_has(closed_loop):
    """With the numbers of the crane. An inner loop of 2 rad/s passes every test but this one."""
    effects = ("limits", "sensing", "delay", "friction", "rope", "body", "wind", "frame")
    overrides = [f"effects.{name}={{}}" for name in effects]
    runs = closed_loop(SCENARIO, "cascade", plants=["mujoco"], drive="velocity", overrides=overrides)
    assert_limits(runs, max_error_m=0.8, max_rest_error_m=0.1)


def test_nothing_changes_unnoticed(runs, assert_golden):
    """Against tests/golden/, which `pytest --cranectl-update` writes."""
    assert_golden(runs)
