"""Results that bound one another: what contradicts itself is told as an internal error."""

from math import inf, nan

import pytest

from cranectl.support.consistency import InconsistentError


def test_values_must_ascend() -> None:
    InconsistentError.check_ascending(("a", 1.0), ("b", 1.0), ("c", 2.0), ("d", inf), ("e", inf))
    InconsistentError.check_ascending(("a", 1.0), ("b", None), ("c", nan), ("d", 1.0))
    InconsistentError.check_ascending(("a", 1.0 + 1e-12), ("b", 1.0), rounding=1e-9)
    for middle in (None, nan, 2.0):
        with pytest.raises(InconsistentError, match="is 2, above the largest, which is 1"):
            InconsistentError.check_ascending(
                ("the smallest", 2.0), ("the mean", middle), ("the largest", 1.0)
            )
    with pytest.raises(InconsistentError, match="a is inf, above b"):
        InconsistentError.check_ascending(("a", inf), ("b", 1.0), rounding=1e-3)


def test_a_sum_must_be_that_of_its_parts() -> None:
    InconsistentError.check_sum("runs", 6, (1, 2, 3))
    InconsistentError.check_sum("share", 1.0, [0.1] * 10)
    for total in (5, nan):
        with pytest.raises(InconsistentError, match=r"runs is (5|nan), and its parts add up to 6"):
            InconsistentError.check_sum("runs", total, (1, 2, 3))
