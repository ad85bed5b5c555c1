"""Patterns over signal names, and what is said of one that matches nothing."""

import pytest

from cranectl.support.errors import InputError

NAMES = ["mujoco.state.alpha", "mujoco.state.beta", "mujoco.load.load_x", "reference.load_x"]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("*", NAMES),
        ("mujoco.state.*", NAMES[:2]),
        ("*.load_x", NAMES[2:]),
        ("mujoco.*_x", [NAMES[2]]),
        ("mujoco.state.[ab]*a", NAMES[:2]),
    ],
)
def test_matching(pattern: str, expected: list[str]) -> None:
    assert InputError.matching(pattern, NAMES) == expected


@pytest.mark.parametrize("pattern", ["mujoco.state.Alpha", "state"])
def test_capitals_and_the_whole_name_count(pattern: str) -> None:
    with pytest.raises(InputError, match="no signal matches"):
        InputError.matching(pattern, NAMES)


def unmatched(pattern: str) -> InputError:
    with pytest.raises(InputError) as raised:
        InputError.matching(pattern, NAMES)
    return raised.value


def test_a_pattern_that_matches_nothing_is_corrected_by_the_nearest() -> None:
    error = unmatched("mujoco.state.alhpa")
    assert error.found == "no signal matches 'mujoco.state.alhpa'"
    assert "nearest being mujoco.state.alpha" in error.allowed
    assert error.remedy == "did you mean 'mujoco.state.alpha'?"
    assert unmatched("mujoco.sate.*").remedy == "did you mean 'mujoco.state.*'?"
    assert "did you mean" not in unmatched("zzzz").remedy
