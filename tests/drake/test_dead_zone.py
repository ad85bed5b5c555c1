"""Drake with velocity drives that have a dead zone."""

from tests.plants.test_dead_zone import assert_agrees


def test_plants_agree() -> None:
    assert_agrees("drake", "lqr")
