"""Drake with velocity drives that have a dead zone."""

from tests.plants.test_dead_zone import assert_agrees


def test_drake_and_mujoco_agree_with_a_dead_zone() -> None:
    assert_agrees("drake", "lqr")
