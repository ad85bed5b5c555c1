"""Collect the results of many cases in a validation, for tables, JSON, JUnit XML and pages."""

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from cranectl.cases.case import Case, CaseResult, Failure, RunSummary
from cranectl.cases.workers import CasesOutcome, Done, run_cases
from cranectl.compare import Agreement
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.plants import PLANTS
from cranectl.support import InconsistentError, JUnitCase

Kind = Literal["passed", "failed", "error"]  # error: no result


class Verdict(NamedTuple):
    """Verdict on a case, or on a scenario that cannot be loaded (without case, controller and drive)."""

    scenario: str  # name or file, as requested
    controller: str  # its name, or empty
    drive: str  # kind of drive, or empty
    plants: tuple[str, ...]  # names of the plants
    kind: Kind  # passed, failed, or error if there is no result
    faults: tuple[str, ...]  # sentences that say why it did not pass
    log: str  # empty without a log
    overrun: float = math.inf  # largest ratio of a value to its limit; inf for an unexpected end
    case: Case | None = None  # what was run; None if the scenario cannot be loaded
    result: CaseResult | None = None  # None for the kind error

    @property
    def name(self) -> str:
        """Controller and drives in words."""
        return f"{self.controller} with {self.drive} drives"

    @property
    def sort_key(self) -> tuple[bool, float]:
        """Key that sorts cases, the worst last."""
        return self.kind != "passed", self.overrun

    def command(self, options: Sequence[str]) -> str:
        """Return the command that runs this case alone, with `options` of the validation."""
        parts = ["cranectl", "run", self.scenario]
        plants = (PLANTS.entry(name).argument for name in self.plants)
        if self.controller:
            parts += ["--controller", ALL_CONTROLLERS.argument(self.controller), "--drive", self.drive]
        return shlex.join([*parts, "--plants", ",".join(plants), *options])


@dataclass(frozen=True)
class Validation:
    """Cases with their outcome, and failures to load scenarios, by the requested name or file."""

    cases: tuple[Case, ...]  # in the order of the request
    outcome: CasesOutcome  # their results in the same order, and whether an interrupt ended them
    unloaded: Mapping[str, Failure]  # by the requested name or file of a scenario that cannot be loaded
    plants: tuple[str, ...]  # all plants of the cases, or those requested if there is no case

    @classmethod
    def run(
        cls,
        cases: Sequence[Case],
        unloaded: Mapping[str, Failure],
        plants: tuple[str, ...],
        *,
        jobs: int,
        done: Done | None = None,
    ) -> "Validation":
        """Run all cases as `run_cases` does."""
        return cls(tuple(cases), run_cases(cases, jobs=jobs, done=done), unloaded, plants)

    def __post_init__(self) -> None:
        """Raise InconsistentError unless every case has exactly one outcome."""
        failed = sum(isinstance(result, Failure) for result in self.outcome.results)
        missing = sum(result is None for result in self.outcome.results)
        InconsistentError.check_sum(
            "the number of cases", len(self.cases), (len(self.finished), failed, missing)
        )

    @property
    def results(self) -> list[tuple[Case, CaseResult]]:
        """Cases with a result."""
        return [(case, result) for case, result in self._pairs() if isinstance(result, CaseResult)]

    @property
    def finished(self) -> list[CaseResult]:
        """Results of finished cases."""
        return [result for result in self.outcome.results if isinstance(result, CaseResult)]

    @property
    def judged(self) -> list[CaseResult]:
        """Results of cases that were not interrupted."""
        return [result for result in self.finished if not result.interrupted]

    @property
    def runs(self) -> list[RunSummary]:
        """Runs of all finished cases."""
        return [run for result in self.finished for run in result.runs]

    @property
    def agreements(self) -> list[Agreement]:
        """Agreements of all cases that were not interrupted."""
        return [agreement for result in self.judged for agreement in result.agreements]

    @property
    def other_failures(self) -> list[str]:
        """Other failures of the case of each agreement, in words; empty if there are none."""
        return [result.other_failures for result in self.judged for _ in result.agreements]

    @property
    def without_result(self) -> list[Case]:
        """Cases without result, because of an interrupt or the end of a worker process."""
        return [case for case, result in self._pairs() if result is None]

    @property
    def failures(self) -> list[tuple[str, Case | None, Failure]]:
        """Failures with the requested scenario and the case, which is None for a whole scenario."""
        failed: list[tuple[str, Case | None, Failure]] = [
            (name, None, failure) for name, failure in self.unloaded.items()
        ]
        pairs = self._pairs()
        return failed + [(case.source, case, result) for case, result in pairs if isinstance(result, Failure)]

    @property
    def interruption(self) -> str:
        """How far it came before an interrupt, in words; empty if there was none."""
        if not self.outcome.interrupted:
            return ""
        ended = len(self.judged) + sum(isinstance(result, Failure) for result in self.outcome.results)
        return f"interrupted after {ended} of {len(self.cases)} cases: no verdict"

    @property
    def missing_reason(self) -> str:
        """The reason why cases have no result, the same for all of them."""
        return "interrupted before it ran" if self.outcome.interrupted else "its worker process died"

    @property
    def verdicts(self) -> list[Verdict]:
        """One verdict per case, after those on scenarios that cannot be loaded."""
        verdicts = [
            Verdict(name, "", "", self.plants, "error", (failure.reason,), "")
            for name, failure in self.unloaded.items()
        ]
        return verdicts + [self._verdict(case, result) for case, result in self._pairs()]

    def _pairs(self) -> list[tuple[Case, CaseResult | Failure | None]]:
        return list(zip(self.cases, self.outcome.results, strict=True))

    def _verdict(self, case: Case, result: CaseResult | Failure | None) -> Verdict:
        labels = case.source, case.controller, case.drive, case.plants
        if isinstance(result, CaseResult):
            kind: Kind = "passed" if result.passed else "failed"
            log, overrun = str(result.log or ""), _overrun(result)
            return Verdict(*labels, kind, tuple(_faults(result)), log, overrun, case, result)
        fault = result.reason if result is not None else f"no result: {self.missing_reason}"
        return Verdict(*labels, "error", (fault,), "", case=case)

    def junit_cases(self, options: Sequence[str]) -> list[JUnitCase]:
        """Return a test for each verdict, in the group of its scenario."""
        cases = []
        for verdict in self.verdicts:
            parts = filter(None, (verdict.controller, verdict.drive, ", ".join(verdict.plants)))
            lines = [*verdict.faults, f"again: {verdict.command(options)}"]
            lines += [f"log: {verdict.log}"] if verdict.log else []
            seconds = verdict.result.seconds if verdict.result else 0.0
            cases.append(JUnitCase(verdict.scenario, " / ".join(parts), verdict.kind, lines, seconds))
        return cases

    def to_json(self, *, passed: bool) -> dict[str, Any]:
        """Return the validation as plain data."""
        return {
            "passed": passed,
            "interrupted": self.outcome.interrupted,
            "runs": [run.to_json() for run in self.runs],
            "agreements": [agreement.to_json() for agreement in self.agreements],
            "failed": [
                {
                    "scenario": name,
                    "controller": case and case.controller,
                    "drive": case and case.drive,
                    "reason": failure.reason,
                    "bad_input": failure.bad_input,
                }
                for name, case, failure in self.failures
            ],
            "lost": [
                {"scenario": case.scenario.name, "controller": case.controller, "drive": case.drive}
                for case in self.without_result
            ],
        }


def _overrun(result: CaseResult) -> float:
    """Return the largest ratio of a judged value to its limit."""
    agreements = [agreement.excess for agreement in result.agreements if agreement.limit_m is not None]
    limits = [limit.overrun for run in result.runs for limit in run.limits]
    return max([*agreements, *limits], default=0.0) if result.as_expected else math.inf


def _faults(result: CaseResult) -> Iterator[str]:
    """Yield a sentence for each reason why the case does not pass."""
    for run in result.runs:
        if run.status.label != result.expected:
            yield f"{run.plant} ends with {run.status.label} at {run.end_s:g} s, expected {result.expected}"
    for agreement in result.agreements:
        if agreement.passed is False:
            yield (
                f"{agreement.plant} and {agreement.reference} differ by "
                f"{agreement.max_load_error_m:.2e} m and "
                f"{agreement.max_angle_error_rad:.2e} rad, limits {agreement.limit_m:.2e} m and "
                f"{agreement.limit_rad:.2e} rad"
            )
    for run, limit in RunSummary.judged_limits(result.runs):
        if not limit.kept:
            yield f"{run.plant} {limit.fault}"
