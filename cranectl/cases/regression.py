"""A log judged by its golden one, all plants that both have."""

from pathlib import Path
from typing import Any, NamedTuple

from cranectl.compare.golden import RegressionVerdict, Tolerances, judge_regression
from cranectl.compare.runs import differing_fields
from cranectl.log import describe_log, read_log
from cranectl.support.errors import InputError
from cranectl.support.provenance import provenance_differences


class Regression(NamedTuple):
    """What came of it."""

    verdicts: list[RegressionVerdict]
    unshared: dict[str, Path]  # plants that only one log has, and which
    differing_fields: list[str]
    software_differences: list[str]

    @property
    def passed(self) -> bool:
        """Whether every plant that both have keeps its limits."""
        return all(verdict.passed for verdict in self.verdicts)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "passed": self.passed,
            "differing_fields": self.differing_fields,
            "software_differences": self.software_differences,
            "verdicts": [verdict.to_json() for verdict in self.verdicts],
        }


def regression_of(new_log: Path, golden_log: Path, tolerances: Tolerances) -> Regression:
    """Judge `new_log`; raises InputError for logs that cannot be read or have no plant in common."""
    new, golden = read_log(new_log), read_log(golden_log)
    shared = [plant for plant in new if plant in golden]
    if not shared:
        raise nothing_shared()
    return Regression(
        verdicts=[judge_regression(new[plant], golden[plant], tolerances) for plant in shared],
        unshared={
            plant: new_log if plant in new else golden_log for plant in sorted(new.keys() ^ golden.keys())
        },
        differing_fields=list(differing_fields(golden[shared[0]], new[shared[0]])),
        software_differences=software_differences(golden_log, new_log),
    )


def software_differences(log: Path, other: Path) -> list[str]:
    """What may make the numbers of two logs differ besides their runs, by `log` and by `other`."""
    return provenance_differences(describe_log(log).versions, describe_log(other).versions, word="other")


def nothing_shared() -> InputError:
    """The error of two logs that cannot be compared."""
    return InputError(
        "the logs share no plant",
        allowed="logs of the same plant",
        remedy="run one of them again, with a plant of the other",
    )
