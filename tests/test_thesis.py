"""The thesis's tables: printed values against both plants.

Where the reading of the text is not obvious, docs/scenarios.md says which was taken.
"""

import pytest

from cranectl.plants.interface import PLANTS
from tests.conftest import closed_loop

# Table 5.1: max x_c'', max y_c'' [m/s²].
TABLE_5_1 = {
    "pole-placement": (0.3995, 0.4222),
    "pole-placement+hinf": (0.3959, 0.3960),
    "pole-placement+loop-shaping": (0.3811, 0.3864),
    "lqr": (0.2874, 0.2918),
    "lqr+hinf": (0.3746, 0.3719),
    "lqr+loop-shaping": (0.2639, 0.2644),
}
# Table 5.2: final load position, at 25 s [m].
TABLE_5_2 = {
    "pole-placement": (1.34, 1.12, -0.62),
    "pole-placement+hinf": (1.01, 0.78, -0.69),
    "pole-placement+loop-shaping": (1.0, 0.77, -0.7),
    "lqr": (1.15, 0.92, -0.67),
    "lqr+hinf": (1.01, 0.78, -0.69),
    "lqr+loop-shaping": (1.0, 0.77, -0.7),
}
# Table 5.3: max x_c'', max y_c'' over 0 to 20 s [m/s²].
TABLE_5_3 = {
    "pole-placement": (0.7749, 0.6670),
    "pole-placement+hinf": (0.8148, 0.6172),
    "pole-placement+loop-shaping": (0.8702, 0.6530),
    "lqr": (0.7903, 0.6468),
    "lqr+hinf": (0.7417, 0.6711),
    "lqr+loop-shaping": (0.8258, 0.6378),
}
# Table 5.4: load position at 20 s [m].
TABLE_5_4 = {
    "pole-placement": (1.99, 1.11, -0.63),
    "pole-placement+hinf": (1.67, 0.79, -0.70),
    "pole-placement+loop-shaping": (1.67, 0.79, -0.71),
    "lqr": (1.80, 0.92, -0.67),
    "lqr+hinf": (1.66, 0.77, -0.69),
    "lqr+loop-shaping": (1.66, 0.77, -0.71),
}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", TABLE_5_1)
def test_table_5_1_trolley_columns(controller: str, plant: str) -> None:
    inputs = closed_loop("fixed-position", controller, plant).block("input")[:, :2]
    assert inputs.max(axis=0) == pytest.approx(TABLE_5_1[controller], rel=0.03 if "+" in controller else 0.01)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", TABLE_5_2)
def test_table_5_2_final_position(controller: str, plant: str) -> None:
    load = closed_loop("fixed-position", controller, plant).block("load")[-1, :3]
    assert load == pytest.approx(TABLE_5_2[controller], abs=0.01)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", TABLE_5_3)
def test_table_5_3_trolley_columns(controller: str, plant: str) -> None:
    run = closed_loop("settled-trajectory", controller, plant)
    inputs = run.block("input")[run.time <= 20.0, :2]
    assert inputs.max(axis=0) == pytest.approx(TABLE_5_3[controller], rel=0.06)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", TABLE_5_4)
def test_table_5_4_position_at_20_seconds(controller: str, plant: str) -> None:
    run = closed_loop("settled-trajectory", controller, plant)
    assert run.time[20_000] == 20.0
    assert run.block("load")[20_000, :3] == pytest.approx(TABLE_5_4[controller], abs=0.015)
