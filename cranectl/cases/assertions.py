"""Assertions for tests of closed loops: plants agree, limits are kept, runs equal golden ones.

A failed assertion names signal, time, size and limit.
"""

import functools
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path
from typing import ParamSpec

from cranectl.cases.case import Case
from cranectl.cases.regression import Regression
from cranectl.compare import Agreement, AgreementLimits, Tolerances, compare_runs, judge
from cranectl.log import LogDescription, read_log, write_log
from cranectl.metrics import Limits, LimitVerdict, run_metrics
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import Arguments, InputError, Provenance, Quantity

MAX_SHOWN_SIGNALS = 3  # of a run that differs from its golden run
GOLDEN_SAMPLES = 50  # at least; once deterministic runs differ, they stay different

P = ParamSpec("P")


def without_traceback(function: Callable[P, None]) -> Callable[P, None]:
    """Make assertions and input errors of `function` point at the line that calls it."""

    @functools.wraps(function)
    def asserting(*args: P.args, **kwargs: P.kwargs) -> None:
        __tracebackhide__ = True
        try:
            function(*args, **kwargs)
        except (AssertionError, InputError) as error:
            raise error.with_traceback(None) from None

    return asserting


class CaseRuns(dict[str, Run]):
    """The runs of a case, by plant."""

    def __init__(self, case: Case) -> None:
        """Simulate the runs; raise InputError for wrong input, and KeyboardInterrupt if interrupted."""
        super().__init__({run.plant: run for run in case.simulate(case.prepare())})
        if any(run.status == RunStatus.INTERRUPTED for run in self.values()):
            raise KeyboardInterrupt
        self.case = case

    def __repr__(self) -> str:
        """Return a short text, since pytest shows it with every failure."""
        return f"{self.case.scenario.name}, {self.case.controller}, {self.case.drive} drives"

    def write(self, path: Path) -> Path:
        """Write all runs to a log, at the rate that the scenario states; raise LogError."""
        return write_log(path, list(self.values()))

    def write_golden(self, path: Path) -> Path:
        """Write a log that is small enough for a repository; raise LogError."""
        scenario = self.case.scenario
        samples = round(scenario.duration * NANOSECONDS / scenario.period_ns)
        return write_log(path, list(self.values()), every=max(samples // GOLDEN_SAMPLES, 1))

    @without_traceback
    def assert_regression(self, golden_log: Path, tolerances: str) -> None:
        """Assert that these new runs agree with those of a golden log.

        Parameters
        ----------
        golden_log : Path
            Log of the golden runs.
        tolerances : str
            Name of shipped tolerances, or a TOML file.

        Raises
        ------
        AssertionError
            If a run differs by more than the tolerances.
        InputError
            For tolerances that cannot be read, and runs that cannot be compared.
        LogError
            For a log that cannot be read.
        """
        golden = read_log(golden_log)
        regression = Regression.of(self, golden, Tolerances.load(tolerances))
        unpaired = sorted(regression.missing + regression.added)
        faults = [f"only golden or only new: {plant}" for plant in unpaired]
        for verdict in regression.verdicts:
            plant = verdict.plant
            if not (verdict.same_status and verdict.ends_passed):
                ends = [f"{run.status.label} at {run.end_s:g} s" for run in (self[plant], golden[plant])]
                faults.append(f"{plant} ends with {ends[0]}, golden with {ends[1]}")
            failed = [signal for signal in verdict.worst_first if not signal.passed]
            faults += [
                f"{plant} differs from golden in {_difference(s.signal, s.unit, s.max_abs, s.at_s, s.limit)}"
                for s in failed[:MAX_SHOWN_SIGNALS]
            ]
            if len(failed) > MAX_SHOWN_SIGNALS:
                faults.append(f"and in {len(failed) - MAX_SHOWN_SIGNALS} more signals")
        if faults:
            settings = regression.differing_fields.first
            differing = [f"golden and new differ in {setting}" for setting in settings]
            made_by = LogDescription.of(golden_log).versions
            versions = Provenance.differences(made_by, Provenance.now(), word="new")
            software = [f"golden was made by other software: {version}" for version in versions]
            where = f"golden: {golden_log}; if the new run is right, pytest --cranectl-update keeps it"
            _raise_for([*differing, *faults], [*software, where])


@without_traceback
@Arguments.checked
def assert_agree(runs: CaseRuns, *, load_m: float | None = None, angle_rad: float | None = None) -> None:
    """Assert that the plants agree and that their runs ended as the scenario expects.

    Parameters
    ----------
    runs : CaseRuns
        Runs of two or more plants, as the fixture `closed_loop` returns them.
    load_m, angle_rad : float, optional
        Limits [m], [rad] in place of those of the numerics.

    Raises
    ------
    AssertionError
        If plants disagree or a run ended otherwise.
    InputError
        For a single plant, and where no limits are known.
    """
    pairs = Agreement.pairs(list(runs.values()))
    if not pairs:
        raise InputError(
            f"a run of {', '.join(runs)} only", allowed="two plants or more", remedy="name more in 'plants'"
        )
    is_limited = load_m is not None or angle_rad is not None
    case = runs.case
    standard_limits = {} if is_limited else AgreementLimits.between(case.scenario, case.drive, case.plants)
    faults, hints = _unexpected_ends(runs), []
    for a, b in pairs:
        comparison = compare_runs(a, b, signals=("state.alpha", "state.beta"))
        limits = standard_limits.get((a.plant, b.plant)) or _stated_limits(runs, load_m, angle_rad)
        agreement = judge(a, b, limits=limits, comparison=comparison)
        if not isinstance(limits, AgreementLimits):
            raise InputError(
                f"no limits of agreement are known for this case: {limits.reason}",
                allowed="scenarios, controllers and drives with known limits, or limits of your own",
                remedy="give limits, as in assert_agree(runs, load_m=0.01, angle_rad=0.02)",
            )
        position = (
            "load position",
            "m",
            comparison.max_load_error_m,
            comparison.max_load_error_at_s,
            limits.load_m,
        )
        angles = [(s.signal, s.unit, s.max_abs, s.at_s, limits.angle_rad) for s in comparison.signals]
        pair = f"{a.plant} and {b.plant} differ in"
        faults += [
            f"{pair} {_difference(*difference)}"
            for difference in (position, *angles)
            if not difference[2] <= difference[-1]
        ]
        if abs(a.end_ns - b.end_ns) > limits.end_s * NANOSECONDS:
            faults.append(f"{a.plant} ends at {a.end_s:g} s, {b.plant} at {b.end_s:g} s")
        if not agreement.passed and not is_limited:
            step = Agreement.judge_steps((a, b), limits).curing_step_s
            if step is not None:
                hints.append(f"they agree with control.physics_step = {Quantity(step).setting()}")
    _raise_for(faults, hints)


@without_traceback
@Arguments.checked
def assert_limits(runs: CaseRuns, **limits: float) -> None:
    """Assert that every run keeps its limits and ended as the scenario expects.

    Parameters
    ----------
    runs : CaseRuns
        Runs, as the fixture `closed_loop` returns them.
    **limits : float
        Limits by metric, such as `max_error_m=0.05`, in place of those of the scenario's [limits].

    Raises
    ------
    AssertionError
        If a limit is broken or a run ended otherwise.
    InputError
        For unknown metrics, and if there is no limit at all.
    """
    faults = _unexpected_ends(runs)
    stated = Limits.from_table(limits, "assert_limits").given
    for plant, plant_limits in Limits.by_plant(runs.case.scenario, runs).items():
        limits_to_keep = {**plant_limits, **stated}
        if not limits_to_keep:
            raise InputError(
                f"no limit for the run of {plant}",
                allowed="[limits] in the scenario, or arguments of assert_limits",
                remedy="give limits, as in assert_limits(runs, max_error_m=0.05)",
            )
        for verdict in LimitVerdict.judge(run_metrics(runs[plant]), limits_to_keep):
            if not verdict.kept:
                since = verdict.broken_since(runs[plant])
                when = "" if since is None else f", from {since:g} s on"
                faults.append(f"{plant} {verdict.fault}{when}")
    _raise_for(faults)


def _stated_limits(runs: CaseRuns, load_m: float | None, angle_rad: float | None) -> AgreementLimits:
    """Return limits for every pair from arguments; ends may differ by the lag of the slowest drive."""
    return AgreementLimits(
        load_m=inf if load_m is None else load_m,
        angle_rad=inf if angle_rad is None else angle_rad,
        end_s=float(runs.case.scenario.rig.time_constants.max()),
        reason="given",
    )


def _unexpected_ends(runs: CaseRuns) -> list[str]:
    """Return a sentence for each run that did not end as expected."""
    return [
        f"{run.plant} ends with {run.status.label} at {run.end_s:g} s, expected {run.scenario.expected}"
        for run in runs.values()
        if not run.ended_as_expected
    ]


def _difference(signal: str, unit: str, size: float, at_s: float, limit: float) -> str:
    return f"{signal} by {Quantity(size, unit)} at {at_s:g} s, limit {Quantity(limit, unit)}"


def _raise_for(faults: Sequence[str], hints: Sequence[str] = ()) -> None:
    """Raise AssertionError if there are faults."""
    if faults:
        raise AssertionError("\n".join([*faults, *hints]))
