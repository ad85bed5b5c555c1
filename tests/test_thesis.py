"""The thesis's tables, rows without robustification: printed values against both plants.

Where the reading of the text is not obvious, docs/scenarios.md says which was taken.
"""

import pytest

from cranectl.plants.interface import PLANTS
from tests.conftest import closed_loop

# Table 5.1: max x_c'', max y_c'' [m/s²].
TABLE_5_1 = {"pole-placement": (0.3995, 0.4222), "lqr": (0.2874, 0.2918)}
# Table 5.2: final load position, at 25 s [m].
TABLE_5_2 = {"pole-placement": (1.34, 1.12, -0.62), "lqr": (1.15, 0.92, -0.67)}
# Table 5.4: load position at 20 s [m].
TABLE_5_4 = {"pole-placement": (1.99, 1.11, -0.63), "lqr": (1.80, 0.92, -0.67)}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", TABLE_5_1)
def test_table_5_1_trolley_columns(controller: str, plant: str) -> None:
    inputs = closed_loop("fixed-position", controller, plant).block("input")[:, :2]
    assert inputs.max(axis=0) == pytest.approx(TABLE_5_1[controller], rel=0.01)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", TABLE_5_2)
def test_table_5_2_final_position(controller: str, plant: str) -> None:
    load = closed_loop("fixed-position", controller, plant).block("load")[-1, :3]
    assert load == pytest.approx(TABLE_5_2[controller], abs=0.015)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", TABLE_5_4)
def test_table_5_4_position_at_20_s(controller: str, plant: str) -> None:
    run = closed_loop("settled-trajectory", controller, plant)
    load = run.block("load")[run.time == 20.0, :3][0]
    assert load == pytest.approx(TABLE_5_4[controller], abs=0.015)
