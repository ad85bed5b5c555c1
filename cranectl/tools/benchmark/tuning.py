"""Tune a controller: find the numbers with the least mean cost over cranes that the ranking does not use.

The search is CMA-ES over the logarithms of the numbers within their bounds. All candidates run on the same
cranes. The result contains every candidate, with the untuned controller first. On other cranes the untuned
numbers then compete with those found with half and with all of the budget.

References
----------
Hansen, The CMA Evolution Strategy: A Tutorial, 2016.
"""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, product, starmap, takewhile
from typing import Any, NamedTuple

import numpy as np

from cranectl.campaign import (
    Batch,
    Campaign,
    Children,
    PreparedCampaign,
    Row,
    StoppedError,
    check_values,
    failed,
    make_worker,
)
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.metrics import Metric
from cranectl.scenario import Scenario
from cranectl.simulate import Loop
from cranectl.status import RunStatus
from cranectl.support import InconsistentError, InputError, MachineError
from cranectl.tools.benchmark.declared import Variable, assignments, variables_of
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.trials import follows, trial_campaign

# Costs of a run, see `run_cost`.
MAX_COMPLETED, STOPPED, REFUSED = 5.0, 10.0, 20.0
INITIAL_DEVIATION = 0.2  # standard deviation of the first candidates, between the bounds 0 and 1

Advance = Callable[[int], None]  # called with the number of runs that have ended since the last call


def run_cost(row: Row, scenario: Scenario, exceeds_limit: bool, variation_price: float) -> float:
    """Return the cost of one run of `scenario`; `exceeds_limit` is True if it exceeds one of its limits.

    A run that completes costs 5 c / (5 + c), which is less than 5. With a sum Σ over all drives,
    c = (rms_error_m + final_error_m) / (5 settling_tolerance) + residual_sway_about_lean_rad / 0.1
    + saturated_s / duration + variation_price Σ command_variation_m_s2 / (g duration).

    A run that exceeds a limit costs 5 more. A run that stops early costs 10 plus the missing share of the
    duration. So a failed run always costs more than a successful one, and less the later it stops. If the
    controller refuses its numbers, each run costs 20.
    """
    if row["status"] != RunStatus.COMPLETED.label:
        return STOPPED + 1.0 - _number(row["end_s"]) / scenario.duration
    variation = sum(_number(row[name]) for name in Metric.named("command_variation_m_s2").columns)
    cost = (
        (_number(row["rms_error_m"]) + _number(row["final_error_m"]))
        / (5.0 * scenario.metrics.settling_tolerance)
        + _number(row["residual_sway_about_lean_rad"]) / 0.1
        + _number(row["saturated_s"]) / scenario.duration
        + variation_price * variation / (scenario.rig.gravity * scenario.duration)
    )
    return MAX_COMPLETED * cost / (MAX_COMPLETED + cost) + (MAX_COMPLETED if exceeds_limit else 0.0)


def _number(value: Any) -> float:
    """Return a metric as a number, which is 0 if the run does not have it."""
    return 0.0 if value is None else float(value)


class Point(NamedTuple):
    """A candidate and its result."""

    values: tuple[float, ...]  # of the variables, on the laboratory rig
    cost: float  # mean over all runs
    failed: float  # share of runs that failed


@dataclass(frozen=True)
class Tuned:
    """Result of a search."""

    controller: str
    variables: tuple[Variable, ...]
    evaluations: int  # number of candidates that the budget allows
    runs_each: int  # number of runs of one candidate
    points: tuple[Point, ...]  # in the order of the search, the untuned controller first
    validated: Mapping[str, Point]  # of `best_points`, on the cranes of validation; empty without these

    @property
    def best_points(self) -> dict[str, Point]:
        """The untuned point, the best with half the budget, and the best with the whole budget."""
        half = self.points[: max(1, self.evaluations // 2)]
        return consistent_points(self.points[0], _best(half), _best(self.points))

    @property
    def chosen(self) -> str:
        """The name in `best_points` with the least cost in validation, the first of equal ones."""
        if not self.validated:
            return "full"
        return min(self.validated, key=lambda name: self.validated[name].cost)

    @property
    def parameters(self) -> dict[str, float]:
        """The chosen numbers by their setting, on the laboratory rig."""
        keys = (variable.key for variable in self.variables)
        return dict(zip(keys, self.best_points[self.chosen].values, strict=True))


def consistent_points(untuned: Point, half: Point, full: Point) -> dict[str, Point]:
    """Return the points by name; raise InconsistentError if a larger budget gave a larger cost."""
    InconsistentError.check_ascending(
        ("the cost with the whole budget", full.cost),
        ("that with half the budget", half.cost),
        ("that of the untuned numbers", untuned.cost),
    )
    return {"untuned": untuned, "half": half, "full": full}


def _best(points: Sequence[Point]) -> Point:
    return min(points, key=lambda point: point.cost)  # the first one of equal costs


class _Place(NamedTuple):
    """Where a candidate runs."""

    scenario: str
    spread: float


@dataclass(frozen=True)
class _Cranes:
    """The cranes on which candidates of a controller run."""

    benchmark: Benchmark
    controller: str
    variables: tuple[Variable, ...]
    plant: str
    draws: int
    seed: int
    timeout: float  # [s], time limit of a controller from a file for a block of samples

    @cached_property
    def campaigns(self) -> dict[_Place, Campaign]:
        """The campaigns of the untuned controller on the scenarios that suit it."""
        tuning, kind = self.benchmark.tuning, follows(self.controller)
        suited = [name for name in tuning.scenarios if kind in self.benchmark.scenarios[name].suits]
        return {place: self._campaign(place) for place in starmap(_Place, product(suited, tuning.spreads))}

    @property
    def runs(self) -> int:
        """Number of runs of one candidate."""
        return sum(campaign.runs for campaign in self.campaigns.values())

    def _campaign(self, place: _Place, settings: Sequence[str] = ()) -> Campaign:
        return trial_campaign(
            self.benchmark,
            place.scenario,
            self.controller,
            plant=self.plant,
            numbers=settings,
            runs=self.draws,
            seed=self.seed,
            spread=place.spread,
        )

    def rows(
        self, place: _Place, values: Sequence[float], children: Children, stop: Callable[[], bool]
    ) -> list[Row]:
        """Run the numbers `values` on all cranes of `place`; raise InputError if they are refused."""
        settings = assignments(self.variables, values, self.campaigns[place].nominal.rig.design_scale)
        campaign = self._campaign(place, settings)
        with closing(make_worker(PreparedCampaign(campaign), children, self.timeout)) as worker:
            return worker.run_batch(Batch(self.plant, self.controller, 0, campaign.runs), stop)

    def costs(self, place: _Place, rows: Sequence[Row]) -> tuple[list[float], int]:
        """Return the costs of all runs at `place`, and the number of failed ones."""
        campaign, penalty = self.campaigns[place], self.benchmark.tuning.variation_price
        failures = failed(lambda name: [row[name] for row in rows], campaign.settings.limits.given)
        costs = [
            run_cost(row, campaign.nominal, bool(has_failed), penalty)
            for row, has_failed in zip(rows, failures, strict=True)
        ]
        return costs, int(failures.sum())


def tune(
    benchmark: Benchmark,
    controller: str,
    *,
    runs: int | None = None,
    workers: int = 1,
    timeout: float = Loop.TIMEOUT,
    advance: Advance = lambda _: None,
    known: Sequence[Point] = (),
    keep: Callable[[Sequence[Point]], None] = lambda _: None,
) -> Tuned:
    """Tune `controller` by the rules of `benchmark`.

    The budget is `runs`, by default that of the benchmark. The result does not depend on the number of
    threads, `workers`. Each thread runs a controller from a file in a child process, with a time limit of
    `timeout` [s] for a block of samples. `keep` receives all points after each generation. `known` are the
    points of the same search if it was interrupted: they do not run again. Raises InputError if the untuned
    controller cannot run, or if the budget is too small.
    """
    variables, rules = variables_of(controller), benchmark.tuning
    cranes = _Cranes(
        benchmark, controller, variables, benchmark.tuning_plant, rules.draws, rules.seed, timeout
    )
    if not cranes.campaigns:
        raise InputError(
            f"'{controller}' follows a {follows(controller)}, and {benchmark.name} tunes on no scenario that "
            "suits it",
            allowed="at least one scenario that suits the controller",
            remedy="add one to [tuning] of the benchmark",
        )
    for campaign in cranes.campaigns.values():
        check_values(campaign)
    budget = rules.runs if runs is None else runs
    evaluations = budget // cranes.runs if variables else 1
    if variables and evaluations < 2:
        raise InputError(
            f"a budget of {budget} runs is too small: one candidate takes {cranes.runs}",
            allowed=f"{2 * cranes.runs} runs or more",
            remedy="raise --runs, or the benchmark's tuning.runs",
        )
    threads = 1 if ALL_CONTROLLERS.run_alone([controller]) else workers
    with _evaluator(cranes, threads, advance) as evaluate:
        points = _search(cranes, evaluations, evaluate, known, keep)
    tuned = Tuned(controller, variables, evaluations, cranes.runs, tuple(points), {})
    if (validation := rules.validation) is None:
        return tuned
    others = replace(cranes, plant=benchmark.plant, draws=validation.draws, seed=validation.seed)
    values = {name: point.values for name, point in tuned.best_points.items()}
    with _evaluator(others, threads, advance) as evaluate:
        distinct = list(dict.fromkeys(values.values()))
        results = dict(zip(distinct, evaluate(distinct, may_refuse=True), strict=True))
    return replace(tuned, validated={name: results[numbers] for name, numbers in values.items()})


def _search(
    cranes: _Cranes,
    evaluations: int,
    evaluate: Callable[..., list[Point]],
    known: Sequence[Point],
    keep: Callable[[Sequence[Point]], None],
) -> list[Point]:
    """Return the points of a search; the first `known` ones of the same search do not run again."""
    variables, points = cranes.variables, list[Point]()

    def add(candidates: Sequence[tuple[float, ...]], *, may_refuse: bool) -> None:
        pairs = zip(known[len(points) :], candidates, strict=False)
        again = [point for point, _ in takewhile(lambda pair: pair[0].values == pair[1], pairs)]
        points.extend([*again, *evaluate(candidates[len(again) :], may_refuse=may_refuse)])
        keep(points)

    add([tuple(variable.start for variable in variables)], may_refuse=False)
    search = _strategy(variables, cranes.seed) if variables else None
    while search is not None and len(points) < evaluations:  # no other criterion ends the search
        positions = search.ask()
        candidates = [
            tuple(v.value_at(p) for v, p in zip(variables, position, strict=False)) for position in positions
        ]
        begun = len(points)
        add(candidates[: evaluations - begun], may_refuse=True)
        if len(points) - begun == len(positions):
            search.tell(positions, [point.cost for point in points[begun:]])
    return points


def _strategy(variables: Sequence[Variable], seed: int) -> Any:
    """Return a CMA-ES search that starts at the untuned numbers; raise InputError without pycma."""
    try:
        import cma
    except ImportError as error:
        raise InputError(
            f"tuning needs pycma: {error}",
            allowed="an installation with the extra 'tune'",
            remedy="pip install 'cranectl[tune]'",
        ) from None
    start = [variable.start_position for variable in variables]
    random = np.random.default_rng(seed)
    options = {
        "bounds": [0.0, 1.0],
        "randn": lambda *shape: random.standard_normal(shape),
        "seed": np.nan,  # do not reseed NumPy's global generator
        "verbose": -9,
        "verb_log": 0,
    }
    start += [] if len(start) > 1 else [0.5]  # CMA-ES needs two coordinates; this one has no effect
    return cma.CMAEvolutionStrategy(start, INITIAL_DEVIATION, options)


@contextmanager
def _evaluator(cranes: _Cranes, workers: int, advance: Advance) -> Iterator[Callable[..., list[Point]]]:
    """Yield a function that runs candidates in threads, which end with the `with` block."""
    stopped = threading.Event()

    def costs(place: _Place, values: Sequence[float], may_refuse: bool) -> tuple[list[float], int]:
        if stopped.is_set():
            raise StoppedError
        try:
            rows = cranes.rows(place, values, children, stopped.is_set)
        except MachineError:  # not caused by the numbers
            raise
        except (InputError, ValueError, ArithmeticError):  # the controller refuses the numbers
            if not may_refuse:
                raise
            runs = cranes.campaigns[place].runs
            return [REFUSED] * runs, runs
        return cranes.costs(place, rows)

    def evaluate(candidates: Sequence[tuple[float, ...]], *, may_refuse: bool) -> list[Point]:
        pending = [
            [pool.submit(costs, place, values, may_refuse) for place in cranes.campaigns]
            for values in candidates
        ]
        points = []
        for values, by_scenario in zip(candidates, pending, strict=True):
            costs_of, failures = zip(*(future.result() for future in by_scenario), strict=True)
            cost = float(np.mean(list(chain(*costs_of))))
            points.append(Point(tuple(values), cost, sum(failures) / cranes.runs))
            advance(cranes.runs)
        return points

    with Children() as children, ThreadPoolExecutor(max(1, workers), thread_name_prefix="tuning") as pool:
        try:
            yield evaluate
        finally:
            stopped.set()
            pool.shutdown(cancel_futures=True)
