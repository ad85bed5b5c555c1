"""Judge a log by a golden log, and pair the runs of two logs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from cranectl.compare import Differences, RegressionVerdict, Tolerances
from cranectl.log import LogDescription, read_log
from cranectl.simulate import Run
from cranectl.support import InputError, Provenance


class Regression(NamedTuple):
    """Result of judging a log against a golden log."""

    verdicts: list[RegressionVerdict]  # one for each plant that both logs have
    missing: tuple[str, ...]  # plants that only the golden log has
    added: tuple[str, ...]  # plants that only the new log has
    differing_fields: Differences  # settings that differ, from the runs on the first of these plants
    software_differences: list[str]  # versions that may explain different numbers, a line for each

    @classmethod
    def of(cls, new: Mapping[str, Run], golden: Mapping[str, Run], tolerances: Tolerances) -> "Regression":
        """Judge new runs by golden ones, both by plant; no software is compared."""
        shared = [plant for plant in new if plant in golden]
        return cls(
            verdicts=[tolerances.judge(new[plant], golden[plant]) for plant in shared],
            missing=tuple(sorted(golden.keys() - new.keys())),
            added=tuple(sorted(new.keys() - golden.keys())),
            differing_fields=Differences.of(golden[shared[0]], new[shared[0]]) if shared else Differences(),
            software_differences=[],
        )

    @property
    def passed(self) -> bool:
        """Whether every plant of the golden log is there and keeps its tolerances."""
        return not self.missing and all(verdict.passed for verdict in self.verdicts)

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data."""
        return {
            "passed": self.passed,
            "missing": self.missing,
            "differing_fields": self.differing_fields,
            "software_differences": self.software_differences,
            "verdicts": [verdict.to_json() for verdict in self.verdicts],
        }


class LogPair:
    """Two logs of runs, of which the second may be golden."""

    def __init__(self, first: Path, second: Path) -> None:
        """Read both; raise LogError."""
        self.paths = first, second
        self.runs = read_log(first), read_log(second)

    @property
    def shared(self) -> list[str]:
        """The plants that both logs have."""
        return [plant for plant in self.runs[0] if plant in self.runs[1]]

    @property
    def pairs(self) -> list[tuple[Run, Run]]:
        """The runs of each plant that both logs share, or the only runs that they hold; else InputError."""
        first, second = self.runs
        if not self.shared and len(first) == len(second) == 1:
            return [(next(iter(first.values())), next(iter(second.values())))]
        self._check_shared()
        return [(first[plant], second[plant]) for plant in self.shared]

    @property
    def software_differences(self) -> list[str]:
        """Differences of software that may explain different numbers."""
        return _software_differences(*self.paths)

    def judge(self, tolerances: Tolerances) -> Regression:
        """Judge the first log by the second, a golden one; raise InputError if they share no plant."""
        self._check_shared()
        regression = Regression.of(*self.runs, tolerances)
        return regression._replace(software_differences=_software_differences(*self.paths[::-1]))

    def _check_shared(self) -> None:
        if not self.shared:
            raise InputError(
                "the logs share no plant",
                allowed="logs of the same plant",
                remedy="run one of them again, with a plant of the other",
            )


def _software_differences(log: Path, other: Path) -> list[str]:
    return Provenance.differences(
        LogDescription.of(log).versions, LogDescription.of(other).versions, word="other"
    )
