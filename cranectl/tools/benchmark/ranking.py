"""Rank the controllers of one division on a set of cranes, over all scenarios that suit all of them."""

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np

from cranectl.campaign import EFFORT
from cranectl.support import Array, InconsistentError
from cranectl.tools.benchmark import scores
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import VARIATION, BenchmarkTable, Runs
from cranectl.tools.benchmark.trials import Division, Trial


class Standing(NamedTuple):
    """Results of one controller on one set of cranes and plant, over all scenarios of the ranking."""

    controller: str  # name of the controller
    runs: int
    failures: int
    settled: float  # share of runs that settle
    unsettled: float  # mean share of the rest phase before the load has settled
    effort: float  # median [m/s²] over all runs; a failed run counts as inf, so half of them make it inf
    variation: float  # median of the commands' variation per second [m/s²]; failed runs count as inf

    @property
    def failed(self) -> float:
        """Share of the runs that failed."""
        return self.failures / self.runs

    def to_json(self) -> dict[str, Any]:
        """Return all fields by the keys of the JSON output."""
        return dict(zip(("law", *self._fields[1:]), self, strict=True))


def checked_standing(*fields: Any) -> Standing:
    """Return a standing; raise InconsistentError if counts or shares contradict each other."""
    standing = Standing(*fields)
    InconsistentError.check_ascending(
        ("failures", standing.failures), (f"runs of {standing.controller}", standing.runs)
    )
    for name, share in (("settled", standing.settled), ("unsettled", standing.unsettled)):
        InconsistentError.check_ascending(
            ("zero", 0.0), (f"the share that {name}", share), ("one", 1.0), rounding=1e-12
        )
    return standing


class Judged(NamedTuple):
    """Results of one division of a benchmark, whose controllers are never ranked with those of another."""

    benchmark: Benchmark
    table: BenchmarkTable
    division: Division
    yours: Collection[str] = ()  # controllers of the reader

    def trial(self, crane_set: str, scenario: str, controller: str, plant: str = "") -> Trial:
        """Return a trial of this division, by default on the benchmark's first plant."""
        return Trial(self.division, plant or self.benchmark.plant, crane_set, scenario, controller)

    def runs(self, crane_set: str, scenario: str, controller: str, plant: str = "") -> Runs | None:
        """Return the runs of a trial of this division, or None if it has none."""
        return self.table.trials.get(self.trial(crane_set, scenario, controller, plant))

    def shared_scenarios(self, crane_set: str) -> list[str]:
        """Return the scenarios that suit all kinds of controllers, and on which any controller has run."""
        group = (self.division, self.benchmark.plant, crane_set)
        with_runs = {trial.scenario for trial in self.table.trials if trial[:3] == group}
        scenarios = self.benchmark.scenarios.items()
        return [name for name, scenario in scenarios if len(scenario.suits) > 1 and name in with_runs]

    def ranking(self, crane_set: str) -> list[Standing]:
        """Return the standing of every controller that has run all shared scenarios on this set.

        Controllers with fewer failures come first; equal ones are ordered by `unsettled`.
        """
        number = len(self.shared_scenarios(crane_set))
        standings = [
            standing for standing, done in self._standings(crane_set).values() if standing and done == number
        ]
        return sorted(standings, key=lambda standing: (standing.failed, standing.unsettled))

    def unfinished(self, crane_set: str) -> dict[str, tuple[Standing | None, int]]:
        """Return the standing of each controller that lacks scenarios, with the number that it has run."""
        number = len(self.shared_scenarios(crane_set))
        return {name: of for name, of in self._standings(crane_set).items() if of[1] < number}

    def front(self, crane_set: str, *, effort_counts: bool = True) -> set[str]:
        """Return the undominated controllers of a ranking, in unsettled time, failures and perhaps effort."""
        standings = self.ranking(crane_set)
        points = points_of(standings) if standings else np.zeros((0, 3))
        best = scores.undominated(points if effort_counts else points[:, [0, 2]])
        return {standing.controller for standing, is_best in zip(standings, best, strict=True) if is_best}

    def fronts_with(self, controller: str) -> str:
        """Return the sets on whose front a controller is, as a phrase; empty if there is none."""
        sets = [name for name in self.benchmark.sets if controller in self.front(name)]
        text = (
            "all sets"
            if sets == [name for name in self.benchmark.sets if self.ranking(name)]
            else ", ".join(sets)
        )
        by_effort = not any(controller in self.front(name, effort_counts=False) for name in sets)
        return f"{text}, by effort alone" if sets and by_effort else text

    def _standings(self, crane_set: str) -> dict[str, tuple[Standing | None, int]]:
        """Return the standing over its shared scenarios of each controller with runs, and their number."""
        group = (self.division, self.benchmark.plant, crane_set)
        shared = self.shared_scenarios(crane_set)
        standings = {}
        for controller in dict.fromkeys(
            trial.controller for trial in self.table.trials if trial[:3] == group
        ):
            by_scenario = {name: self.runs(crane_set, name, controller) for name in shared}
            timed = [
                (runs, float(self.table.about["durations"][name]))
                for name, runs in by_scenario.items()
                if runs is not None
            ]
            standings[controller] = _standing(controller, timed) if timed else None, len(timed)
        return standings

    @property
    def controllers(self) -> list[str]:
        """Names of all controllers that have runs, in any division."""
        return list(dict.fromkeys(trial.controller for trial in self.table.trials))

    @property
    def best_first(self) -> list[str]:
        """All controllers, in the order of the ranking on the set with the widest spread that has runs."""
        widest = sorted(self.benchmark.sets, key=lambda name: -self.benchmark.sets[name].spread)
        standings = next(filter(None, map(self.ranking, widest)), [])
        return list(dict.fromkeys([*(standing.controller for standing in standings), *self.controllers]))

    @property
    def has_yours(self) -> bool:
        """Whether the division has runs of the reader's controllers."""
        return any(t.division == self.division and t.controller in self.yours for t in self.table.trials)

    @property
    def ranked_sets(self) -> list[str]:
        """The sets with a ranking, the one with the widest spread last."""
        sets = self.benchmark.sets
        return sorted(filter(self.ranking, sets), key=lambda name: sets[name].spread)


def _standing(controller: str, timed: Sequence[tuple[Runs, float]]) -> Standing:
    """Return the standing over some scenarios, each with its duration [s]."""
    runs = [r for r, _ in timed]
    failed = np.concatenate([r.failed for r in runs])
    return checked_standing(
        controller,
        failed.size,
        int(failed.sum()),
        float(np.mean([scores.settled_share(r.settling, r.failed) for r in runs])),
        float(np.mean([scores.unsettled_share(r.settling, r.failed, rest_time(r, t)) for r, t in timed])),
        scores.median_with_failures(np.concatenate([r.metrics[EFFORT] for r in runs]), failed),
        scores.median_with_failures(np.concatenate([r.metrics[VARIATION] / t for r, t in timed]), failed),
    )


def points_of(standings: Sequence[Standing]) -> Array:
    """Return (controllers, 3): unsettled share, effort and share of failures; lower is better."""
    return np.array([[s.unsettled, s.effort, s.failed] for s in standings])


def rest_time(runs: Runs, duration: float) -> float:
    """Return the duration of the rest phase after the path [s], in runs of `duration` [s].

    It is the whole duration if no run reaches this phase.
    """
    rest = runs.metrics["rest_s"]
    return duration - (float(np.nanmin(rest)) if np.isfinite(rest).any() else 0.0)
