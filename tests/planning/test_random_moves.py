"""Run a part of `validation/proofs/random_moves.py`."""

import itertools

import pytest

from tests.planning.tasks import share
from validation.proofs import random_moves as program
from validation.proofs.random_moves import plan_and_check, random_moves


# Moves with short planning times; the first has a via point, the second an obstacle.
@pytest.mark.parametrize("index", share([26, 7, 0, 4, 5, 15, 33, 35]))
def test_a_random_move_is_within_its_limits_and_no_slower_than_degree_9(index: int) -> None:
    result = plan_and_check(next(itertools.islice(random_moves(1), index, None)))
    assert result.outcome.startswith(("planned", "degree 9"))
    assert not result.is_wrong, result


def test_program_summarises_only_kinds_of_moves_that_occur(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One move is either free or has an obstacle."""
    monkeypatch.setattr("sys.argv", ["random_moves.py", "--first", "26", "--runs", "1"])
    assert program.main() == 0
    summary = [line for line in capsys.readouterr().out.splitlines() if "CPU median" in line]
    assert len(summary) == 2
    assert summary[-1].startswith("all: 1,")
