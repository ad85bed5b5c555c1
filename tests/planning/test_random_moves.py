"""Run a part of `validation/proofs/random_moves.py`."""

import itertools

import pytest

from tests.planning.tasks import share
from validation.proofs.random_moves import plan_and_check, random_moves


# Moves with short planning times; the first has a via point, the second an obstacle.
@pytest.mark.parametrize("index", share([26, 7, 0, 4, 5, 15, 33, 35]))
def test_a_random_move_is_within_its_limits_and_no_slower_than_degree_9(index: int) -> None:
    result = plan_and_check(next(itertools.islice(random_moves(1), index, None)))
    assert result.outcome.startswith(("planned", "degree 9"))
    assert not result.is_wrong, result
