"""Check results that bound one another, before anything is printed or written.

A violation is an error in this program, not of its user. It ends the command as an unforeseen error. So
contradictory numbers are never shown.
"""

from collections.abc import Iterable
from itertools import pairwise
from math import fsum, isnan


class InconsistentError(RuntimeError):
    """Two results of one computation contradict each other."""

    @staticmethod
    def check_ascending(*named: tuple[str, float | None], rounding: float = 0.0) -> None:
        """Raise InconsistentError unless pairs of name and value ascend; None and NaN are left out.

        `rounding` is the allowed excess, relative to the value that must not be exceeded.
        """
        known = [(name, value) for name, value in named if value is not None and not isnan(value)]
        for (name, value), (next_name, next_value) in pairwise(known):
            if value > next_value and not value - next_value <= rounding * abs(next_value):
                raise InconsistentError(
                    f"internal error: {name} is {value:.12g}, above {next_name}, which is {next_value:.12g}"
                )

    @staticmethod
    def check_sum(name: str, total: float, parts: Iterable[float]) -> None:
        """Raise InconsistentError unless `parts` add up to `total`."""
        added = fsum(parts)
        if added != total:
            raise InconsistentError(
                f"internal error: {name} is {total:.12g}, and its parts add up to {added:.12g}"
            )
