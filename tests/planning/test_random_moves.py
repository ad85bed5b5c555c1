"""A share of `validation/proofs/random_moves.py`."""

import itertools

import pytest

from tests.planning.tasks import share
from validation.proofs import random_moves as program
from validation.proofs.random_moves import ROUNDING, random_moves, result


# Quick ones; the first is through a point, the second beside an obstacle.
@pytest.mark.parametrize("index", share([26, 7, 0, 4, 5, 15, 33, 35]))
def test_a_random_move_is_within_its_limits_and_no_slower_than_degree_9(index: int) -> None:
    found = result(next(itertools.islice(random_moves(1), index, None)))
    assert found.told.startswith(("planned", "degree 9"))
    assert found.excess <= ROUNDING
    assert found.duration <= found.shortest * (1.0 + 1e-12)


def test_the_program_sums_up_kinds_of_moves_that_it_has(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One move cannot be of both kinds."""
    monkeypatch.setattr("sys.argv", ["random_moves.py", "--first", "26", "--runs", "1"])
    assert program.main() == 0
    summary = [line for line in capsys.readouterr().out.splitlines() if "CPU median" in line]
    assert len(summary) == 2
    assert summary[-1].startswith("all: 1,")
