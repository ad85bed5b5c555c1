"""Patterns over signal names, and what is said of one that matches nothing."""

import pytest

from cranectl.support.errors import InputError, matching

NAMES = ["mujoco.state.alpha", "mujoco.state.beta", "mujoco.load.load_x", "reference.load_x"]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("*", NAMES),
        ("mujoco.state.*", NAMES[:2]),
        ("*.load_x", NAMES[2:]),
        ("mujoco.*_x", [NAMES[2]]),
        ("mujoco.state.[ab]*a", NAMES[:2]),
        ("mujoco.state.Alpha", []),
        ("state", []),
    ],
)
def test_matching(pattern: str, expected: list[str]) -> None:
    assert matching(pattern, NAMES) == expected


def test_a_pattern_that_matches_nothing_is_corrected_by_the_nearest() -> None:
    error = InputError.unmatched("mujoco.state.alhpa", NAMES)
    assert error.found == "no signal matches 'mujoco.state.alhpa'"
    assert "nearest being mujoco.state.alpha" in error.allowed
    assert error.remedy == "did you mean 'mujoco.state.alpha'?"
    assert InputError.unmatched("mujoco.sate.*", NAMES).remedy == "did you mean 'mujoco.state.*'?"
    assert "did you mean" not in InputError.unmatched("zzzz", NAMES).remedy
