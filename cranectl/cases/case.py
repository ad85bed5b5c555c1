"""A case: one scenario, controller and drive on several plants, simulated, logged and judged."""

import itertools
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar, Literal

from cranectl.cases.drive_use import beyond_drives
from cranectl.compare import Agreement, AgreementLimits, compare_runs, judge
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.log import check_recordable, write_log
from cranectl.metrics import Limits, LimitVerdict, RunMetrics, run_metrics
from cranectl.plants import PLANTS, Drive
from cranectl.scenario import Scenario
from cranectl.simulate import Loop, Plan, PreparedController, Run, RunMemory, simulate_run
from cranectl.status import RunStatus
from cranectl.support import FileKind, InputError, JSONRecord, MachineError

Keep = Literal["all", "failed", "none"]


@dataclass(frozen=True)
class RunSummary(JSONRecord):
    """Summary of a run after its log is written."""

    scenario: str  # its name
    controller: str  # its name
    plant: str  # its name
    drive: str  # kind of drive
    status: RunStatus  # how the run ended
    end_s: float  # when it ended [s]
    log: Path | None  # None if it is not kept
    metrics: RunMetrics | None  # None for a run without samples
    limits: tuple[LimitVerdict, ...] = ()  # of its scenario
    beyond_drives: str = ""  # commands that drives with limits could not follow, in words

    @property
    def limits_kept(self) -> bool | None:
        """Whether all limits are kept, or None without limits."""
        return all(verdict.kept for verdict in self.limits) if self.limits else None

    @classmethod
    def of(cls, run: Run, log: Path | None) -> "RunSummary":
        """Summarise a run that is in `log`; raise InputError for impossible limits."""
        metrics, stated = run_metrics(run), Limits.by_plant(run.scenario, [run.plant])[run.plant]
        names = run.scenario.name, run.design.name, run.plant, run.drive
        limits, beyond = LimitVerdict.judge(metrics, stated), beyond_drives(run)
        return cls(*names, run.status, run.end_s, log, metrics, limits, beyond)

    @staticmethod
    def judged_limits(runs: "Sequence[RunSummary]") -> "list[tuple[RunSummary, LimitVerdict]]":
        """Return each limit of a case once, with the run that it is judged on.

        That is the run on the reference plant, or another one that alone breaks the limit or has it.
        """
        if not runs:
            return []
        reference = PLANTS.reference(run.plant for run in runs)
        judged: dict[str, tuple[RunSummary, LimitVerdict]] = {}
        for run in sorted(runs, key=lambda run: run.plant != reference):
            for limit in run.limits:
                known = judged.get(limit.metric)
                if known is None or (known[1].kept and not limit.kept):
                    judged[limit.metric] = (run, limit)
        return list(judged.values())

    def to_json(self) -> dict[str, Any]:
        """Return the summary as plain data."""
        return {**super().to_json(), "status": self.status.label}


@dataclass(frozen=True)
class PairDifference:
    """Differences of two plants in a case."""

    agreement: Agreement
    max_tension_error_n: float


@dataclass(frozen=True)
class CaseResult:
    """Result of a case."""

    runs: tuple[RunSummary, ...]  # one for each plant; an interrupted run is the last
    agreements: tuple[Agreement, ...]  # of plants with samples, if the reference plant has samples
    expected: str  # status in which runs should end
    pairs: tuple[PairDifference, ...] = ()  # all pairs of plants, if requested
    seconds: float = field(default=0.0, compare=False)  # that the case took

    @property
    def log(self) -> Path | None:
        """The log of its runs, or None if it is not kept."""
        return self.runs[0].log

    @property
    def interrupted(self) -> bool:
        """Whether a run was interrupted."""
        return any(run.status == RunStatus.INTERRUPTED for run in self.runs)

    @property
    def stopped(self) -> bool:
        """Whether a run stopped before its end."""
        return any(run.status.stopped for run in self.runs)

    @property
    def as_expected(self) -> bool:
        """Whether every run ended as its scenario expects."""
        return all(run.status.label == self.expected for run in self.runs)

    @property
    def plants_agree(self) -> bool:
        """Whether no judged pair of plants disagrees."""
        return all(agreement.passed is not False for agreement in self.agreements)

    @property
    def limits_kept(self) -> bool:
        """Whether all runs keep all their limits."""
        return all(run.limits_kept is not False for run in self.runs)

    @property
    def other_failures(self) -> str:
        """Failures other than disagreement, in words; empty if there are none."""
        faults = {"ended otherwise": not self.as_expected, "limits broken": not self.limits_kept}
        return ", ".join(name for name, present in faults.items() if present)

    @property
    def passed(self) -> bool:
        """Whether the runs ended as expected, the plants agree and limits are kept."""
        return self.as_expected and self.plants_agree and self.limits_kept


@dataclass(frozen=True)
class Failure:
    """The reason why a case has no result."""

    reason: str  # what the error says
    bad_input: bool  # else it is unexpected
    trace: str = ""  # traceback of an unexpected error

    @classmethod
    def of(cls, error: Exception) -> "Failure":
        """Return the failure for `error`."""
        if isinstance(error, InputError):
            return cls(str(error), bad_input=True)
        text = " ".join(InputError.describe(error).split())
        return cls(text, bad_input=False, trace="".join(traceback.format_exception(error)))


@dataclass(frozen=True)
class Case:
    """A case to run, and its log."""

    LOG_DIRECTORY: ClassVar = Path("logs")  # below it a log is written by default

    scenario: Scenario  # what is run
    controller: str  # its name
    drive: Drive  # kind of drive of all runs
    plants: tuple[str, ...]  # their names, in the order of the runs
    log: Path  # file that receives the runs of all plants, unless `keep` is "none"
    source: str  # name or file of the scenario, as requested
    keep: Keep = "all"  # logs to keep
    pairwise: bool = False  # whether every plant is compared with every other
    timeout: float = Loop.TIMEOUT  # [s] for a block of a run with an external controller
    left_out: tuple[str, ...] = ()  # default plants that lack an effect, each with the reason

    @property
    def simulated_seconds(self) -> float:
        """Simulated time of all runs [s]."""
        return self.scenario.duration * len(self.plants)

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        *,
        controller: str | None = None,
        drive: Drive = "ideal",
        plants: Iterable[str] = (),
        log: Path | None = None,
        source: str | None = None,
        keep: Keep = "all",
        pairwise: bool = False,
        timeout: float = Loop.TIMEOUT,
    ) -> "Case":
        """Make a case, by default with the scenario's controller, plants and log.

        A default plant that lacks an effect is left out if others remain; one that is named is refused when
        it runs. Raises InputError for plants that cannot run and for impossible limits.
        """
        requested = tuple(plants)
        plants = PLANTS.to_run(requested, scenario.rig)
        for plant in plants:
            PLANTS.find(plant, scenario.rig)
        left_out = {} if requested else _lacking_effects(scenario, plants, drive)
        plants = tuple(plant for plant in plants if plant not in left_out)
        Limits.by_plant(scenario, plants)
        controller = controller or scenario.controller.name
        log = log or cls.log_in(cls.LOG_DIRECTORY, scenario, controller, drive)
        return cls(
            scenario=scenario,
            controller=controller,
            drive=drive,
            plants=plants,
            log=log,
            source=source or scenario.name,
            keep=keep,
            pairwise=pairwise,
            timeout=timeout,
            left_out=tuple(left_out.values()),
        )

    @staticmethod
    def log_in(directory: Path, scenario: Scenario, controller: str, drive: str) -> Path:
        """Return `DIRECTORY/SCENARIO/CONTROLLER-DRIVE.mcap`."""
        return directory / scenario.name / f"{controller}-{drive}.mcap"

    @staticmethod
    def check_logs_differ(cases: "Sequence[Case]") -> None:
        """Raise InputError if two cases share a log, since the later case would overwrite it."""
        by_log: dict[Path, Case] = {}
        for case in cases:
            other = by_log.setdefault(case.log.resolve(), case)
            if other is not case:
                raise InputError(
                    f"{other.source} and {case.source} would share the log {case.log}",
                    allowed="scenarios of different names, each of them once",
                    remedy="change the 'name' in one of the files, or run them one by one with other --out",
                )

    def prepare(self) -> dict[str, Any]:
        """Return the arguments of `simulate_run` that all runs share; raise InputError."""
        design = ALL_CONTROLLERS.design(self.controller, self.scenario)
        RunMemory(self.scenario).check_runs(design, self.drive, len(self.plants))
        plan = Plan.of(self.scenario)
        return {
            "drive": self.drive,
            "plan": plan,
            "compiled_controller": PreparedController.of(self.scenario, design, self.drive, plan),
            "timeout": self.timeout,
        }

    def simulate(
        self, shared: dict[str, Any], *, progress: Callable[[float], None] | None = None
    ) -> list[Run]:
        """Return a run on each plant with arguments from `prepare`; an interrupted run is the last."""
        runs: list[Run] = []
        for plant in self.plants:
            runs.append(simulate_run(self.scenario, plant=plant, progress=progress, **shared))
            if runs[-1].status == RunStatus.INTERRUPTED:
                break
        return runs

    def run(self, *, progress: Callable[[float], None] | None = None) -> "CaseResult":
        """Simulate, log and judge the runs.

        `progress` is called with simulated seconds. Raises InputError for wrong input, before any simulation.
        An interrupted run is logged and ends the case.
        """
        begin, shared = perf_counter(), self.prepare()
        if self.keep != "none":
            FileKind.MCAP.check_place(self.log, option="--out")
            check_recordable(self.scenario, shared["compiled_controller"].design, self.drive)
        limits = AgreementLimits.between(self.scenario, self.drive, self.plants)
        runs = self.simulate(shared, progress=progress)
        log = None if self.keep == "none" else self.log
        if log is not None:
            write_log(log, runs, limits=limits)
        pairs = Agreement.pairs([run for run in runs if len(run.time_ns)], self.plants)
        result = CaseResult(
            runs=tuple(RunSummary.of(run, log) for run in runs),
            agreements=tuple(
                Agreement.judge_steps(pair, limits[pair[0].plant, pair[1].plant], progress) for pair in pairs
            ),
            expected=self.scenario.expected,
            pairs=_pair_differences(runs) if self.pairwise else (),
            seconds=perf_counter() - begin,
        )
        if self.keep == "failed" and result.passed:
            self.log.unlink()
            return replace(result, runs=tuple(replace(run, log=None) for run in result.runs))
        return result

    def try_run(self, *, progress: Callable[[float], None] | None = None) -> "CaseResult | Failure":
        """Run as `run` does, but return errors as failures, so that other cases can go on."""
        try:
            return MachineError.retry(lambda: self.run(progress=progress))
        except Exception as error:
            return Failure.of(error)


def _lacking_effects(scenario: Scenario, plants: Sequence[str], drive: Drive) -> dict[str, str]:
    """Return a line for each plant with this drive that lacks an effect; none if all plants do."""
    lines = {}
    for plant in plants:
        try:
            entry = PLANTS.entry(plant)
            if drive in entry.drives:
                entry.check_effects(scenario.effects, drive)
        except InputError as reason:
            lines[plant] = f"{scenario.name}: {plant} is left out: {reason.found}"
    return lines if len(lines) < len(plants) else {}


def _pair_differences(runs: Sequence[Run]) -> tuple[PairDifference, ...]:
    differences = []
    runs = [run for run in runs if len(run.time_ns)]
    reference = PLANTS.reference(run.plant for run in runs)
    for a, b in itertools.combinations(runs, 2):
        a, b = (b, a) if a.plant == reference else (a, b)
        comparison = compare_runs(a, b, signals=("load.rope_tension",))
        agreement = judge(a, b, comparison=comparison)
        differences.append(PairDifference(agreement, comparison.signals[0].max_abs))
    return tuple(differences)
