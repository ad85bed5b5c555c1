"""A share of `validation/random_moves.py`, and that it could say no."""

import itertools

import numpy as np
import pytest

from cranectl.reference.planning.limits import Box
from validation.random_moves import ROUNDING, inside, random_moves, result


@pytest.mark.parametrize("index", [0, 4, 5, 7, 15, 26, 33, 35])  # quick ones; one through a point
def test_a_random_move_is_within_its_limits_and_no_slower_than_degree_9(index: int) -> None:
    found = result(next(itertools.islice(random_moves(1), index, None)))
    assert found.told.startswith(("planned", "degree 9"))
    assert found.excess <= ROUNDING
    assert found.duration <= found.shortest * (1.0 + 1e-12)


def test_what_reaches_into_a_box_is_measured() -> None:
    box = Box("box", np.zeros(3) - 1.0, np.ones(3) - 1.5)
    load = np.array([[0.0, 0.0, -2.0], [-0.4, -0.7, -0.7], [-0.7, -0.7, -2.0], [0.0, -0.7, -0.7]])
    trolley = np.array([[0.0, 0.0, 0.0], [-0.4, -0.7, 0.0], [-0.7, -0.7, 0.0], [-0.4, -0.7, 0.0]])
    found = inside(load, trolley, box, 0.15)
    # Clear of it; 0.1 beside; below it, the rope through all of it; 0.5 beside, clear.
    assert found[[0, 3]].max() < 0.0
    assert found[1:3] == pytest.approx([0.05, 0.5])
