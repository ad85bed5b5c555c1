"""Cranes, paths, effects, laws and drives that nobody chose: others with every commit."""

import itertools

import pytest

from cranectl.cases.case import run_case
from validation.proofs import random_cranes

CASES = 8
PLANTS = ("analytic", "elastic", "mujoco")


@pytest.mark.parametrize("k", range(CASES))
def test_random_cranes_agree(k: int) -> None:
    """Every pair that has limits; the seed is in the message."""
    seed = random_cranes.commit()
    case = next(itertools.islice(random_cranes.random_cases(seed, PLANTS), k, None))
    result = run_case(case)
    for pair in result.pairs:
        assert pair.agreement.passed is not False, (seed, k, pair.agreement)


def test_a_seed_makes_the_same_cases_another_others() -> None:
    a, b, c = ([*itertools.islice(random_cranes.random_cases(s, PLANTS), 5)] for s in ("1a", "1a", "1b"))
    assert a == b
    assert a != c
    drawn = [*itertools.islice(random_cranes.random_cases("1a", PLANTS), 40)]
    assert {case.drive for case in drawn} == {"ideal", "velocity", "force"}
    assert {name for case in drawn for name in case.scenario.effects.names} == set(random_cranes.EFFECTS)
    assert {plants for case in drawn for plants in [case.plants]} == {PLANTS, PLANTS[1:]}


def test_the_program_says_what_it_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--seed", "1a", "--cases", "2", "--plants", "analytic,elastic"]
    monkeypatch.setattr("sys.argv", ["random_cranes.py", *options])
    assert random_cranes.main() == 0
    assert "2 random cases, seed 1a" in capsys.readouterr().out
