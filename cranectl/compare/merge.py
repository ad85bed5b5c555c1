"""Two runs of different plants as the pair that one log holds; the caller reads and writes files."""

from collections.abc import Sequence

import numpy as np

from cranectl.plants.registry import PLANTS
from cranectl.simulate import Run
from cranectl.support.errors import InputError

SHOWN = 10  # differences in an error message


def merged_pair(a: Run, b: Run) -> tuple[Run, Run]:
    """Two logged runs in the order of a log of both plants, to be written at the rate that they have.

    Raises InputError if one log cannot hold both: it has one controller, drive, reference and rate.
    """
    if a.plant == b.plant:
        raise InputError(
            f"both logs hold the run of {a.plant}",
            allowed=f"one log each of {' and '.join(PLANTS)}",
            remedy="compare them without --merge",
        )
    for what, values in (
        ("controllers", (a.design.name, b.design.name)),
        ("drives", (a.drive, b.drive)),
        ("numbers of recorded signals", tuple(sum(map(len, run.design.groups)) for run in (a, b))),
    ):
        if values[0] != values[1]:
            raise _unmergeable(a, b, f"different {what}, {values[0]} and {values[1]}")
    if not np.intersect1d(a.time_ns, b.time_ns).size:
        raise _unmergeable(a, b, "no samples in common")
    common = min(len(a.time_ns), len(b.time_ns)) - 1  # the last sample is logged whenever it is
    if not np.array_equal(a.time_ns[:common], b.time_ns[:common]):
        raise _unmergeable(a, b, "different times of their samples")
    if not np.array_equal(a.reference[:common], b.reference[:common]):
        raise _unmergeable(a, b, "different references")
    first, second = sorted((a, b), key=lambda run: list(PLANTS).index(run.plant))
    return first, second


def refuse_differences(what: str, differences: Sequence[str], *, described: str) -> None:
    """Raise InputError if there are any: a merged log describes the run of plant `described` only."""
    if differences:
        more = len(differences) - SHOWN
        shown = [*differences[:SHOWN], *([f"and {more} more"] if more > 0 else [])]
        raise InputError(
            f"{what}: {'; '.join(shown)}",
            allowed="two runs of the same scenario, by the versions that are installed",
            remedy="run one of them again, or merge with --despite-differences: the log then describes the "
            f"{described} run's scenario and the versions that are installed",
        )


def _unmergeable(a: Run, b: Run, what: str) -> InputError:
    return InputError(
        f"the runs of {a.plant} and {b.plant} have {what}",
        allowed="runs of the same scenario, controller and drive, logged at the same rate",
        remedy="run one of them again",
    )
