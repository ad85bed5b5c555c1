"""Collect the results of many cases in a validation, for tables, JSON, JUnit XML and pages."""

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from cranectl.cases.case import Case, CaseResult, Failure, RunSummary, judged_limits
from cranectl.cases.workers import CasesOutcome
from cranectl.compare import Agreement
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.metrics import LimitVerdict, Metric
from cranectl.plants import PLANTS
from cranectl.support import JUnitCase, Outcome, check_sum, difference_in, quantity, scaled

BETWEEN_PLANTS = "plants"  # key of a difference between plants


class Verdict(NamedTuple):
    """Verdict on a case, or on a scenario that cannot be loaded (without case, controller and drive)."""

    scenario: str  # name or file, as requested
    controller: str
    drive: str
    plants: tuple[str, ...]
    kind: Outcome
    faults: tuple[str, ...]  # sentences that say why it did not pass
    log: str  # empty without a log
    overrun: float = math.inf  # largest ratio of a value to its limit; inf for an unexpected end
    case: Case | None = None
    result: CaseResult | None = None

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


class JudgedValue(NamedTuple):
    """A value and its limit in the same unit, as text."""

    key: str  # name of a metric, or BETWEEN_PLANTS
    name: str
    limit: str
    measured: str
    kept: bool  # whether the value is within the limit
    overrun: float  # ratio of value and limit
    sign: str = "≤"

    @property
    def fault(self) -> str:
        """A sentence on a value that exceeds its limit, or the name alone if there is no value."""
        if not self.limit:
            return f"{self.name}."
        return f"{self.name} is {self.measured or 'missing'}, the limit is {self.limit}."


@dataclass(frozen=True)
class Validation:
    """Cases with their outcome, and failures to load scenarios, by the requested name or file."""

    cases: tuple[Case, ...]
    outcome: CasesOutcome
    unloaded: Mapping[str, Failure]
    plants: tuple[str, ...]

    def __post_init__(self) -> None:
        """Raise InconsistentError unless every case has exactly one outcome."""
        failed = sum(isinstance(result, Failure) for result in self.outcome.results)
        missing = sum(result is None for result in self.outcome.results)
        check_sum("the number of cases", len(self.cases), (len(self.finished), failed, missing))

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
            kind: Outcome = "passed" if result.passed else "failed"
            log, overrun = str(result.log or ""), _overrun(result)
            return Verdict(*labels, kind, tuple(_faults(result)), log, overrun, case, result)
        fault = result.reason if result is not None else f"no result: {self.missing_reason}"
        return Verdict(*labels, "error", (fault,), "", case=case)

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
    for run, limit in judged_limits(result.runs):
        if not limit.kept:
            yield f"{run.plant} {limit.fault}"


def junit_cases(verdicts: Sequence[Verdict], options: Sequence[str]) -> list[JUnitCase]:
    """Return a test for each verdict, in the group of its scenario."""
    cases = []
    for verdict in verdicts:
        parts = filter(None, (verdict.controller, verdict.drive, ", ".join(verdict.plants)))
        lines = [*verdict.faults, f"again: {verdict.command(options)}"]
        lines += [f"log: {verdict.log}"] if verdict.log else []
        cases.append(JUnitCase(verdict.scenario, " / ".join(parts), verdict.kind, lines))
    return cases


def judged_values(result: CaseResult) -> Iterator[JudgedValue]:
    """Yield each limit once, as `judged_limits` does, and the largest difference of plants over its limit."""
    reference = PLANTS.reference(run.plant for run in result.runs)
    for run, limit in judged_limits(result.runs):
        yield _judged_limit(limit, "" if run.plant == reference else run.plant)
    judged = [agreement for agreement in result.agreements if agreement.limit_m is not None]
    if judged:
        yield max(map(_judged_agreement, judged), key=lambda value: (not value.kept, value.overrun))


def _judged_limit(limit: LimitVerdict, plant: str) -> JudgedValue:
    """Return a limit on a metric in a readable unit; the name mentions `plant` if it is not empty."""
    metric = Metric.named(limit.metric)
    factor, unit = scaled(metric.unit, max(abs(limit.value or 0.0), limit.limit))
    if metric.unit == "rad":
        factor, unit = math.degrees(1.0), "°"
    value = None if limit.value is None else factor * limit.value
    measured, allowed = replace(limit, value=value, limit=factor * limit.limit).texts
    meaning, sign = metric.meaning.partition(";")[0], "≥" if metric.better == "higher" else "≤"
    name = f"{meaning[0].upper()}{meaning[1:]}{f' ({plant})' if plant else ''}"
    space = "" if unit == "°" else " "
    texts = f"{allowed}{space}{unit}", measured and f"{measured}{space}{unit}"
    return JudgedValue(metric.name, name, *texts, limit.kept, limit.overrun, sign)


def _judged_agreement(agreement: Agreement) -> JudgedValue:
    """Return the difference of two plants in position or in angle, whichever is nearer to its limit."""
    pairs = (
        ("positions", agreement.max_load_error_m, agreement.limit_m, "m"),
        ("angles", agreement.max_angle_error_rad, agreement.limit_rad, "rad"),
    )
    ratios = [math.inf if math.isnan(value) else value / (limit or math.inf) for _, value, limit, _ in pairs]
    quantities, value, limit, unit = pairs[ratios.index(max(ratios))]
    if agreement.passed is False and max(ratios) <= 1.0:
        plants = f"{agreement.plant} and {agreement.reference}"
        name = f"The runs on {plants} end in different ways, or at different times"
        return JudgedValue(BETWEEN_PLANTS, name, "", "", kept=False, overrun=math.inf, sign="")
    name = f"Difference of {quantities} between {agreement.plant} and {agreement.reference}"
    texts = quantity(limit or 0.0, unit), difference_in(value, unit)
    return JudgedValue(BETWEEN_PLANTS, name, *texts, agreement.passed is not False, max(ratios))
