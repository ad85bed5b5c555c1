"""How laws stand on a set of cranes, over all scenarios that suit laws of every kind."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cranectl.campaign.benchmark import scores
from cranectl.campaign.benchmark.pieces import Division, Trial
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.table import VARIATION, BenchmarkTable, Runs
from cranectl.campaign.summary import EFFORT
from cranectl.support.arrays import Array
from cranectl.support.consistency import check_ascending


class Standing(NamedTuple):
    """A law on one set of cranes and plant, over all scenarios that suit laws of every kind."""

    law: str
    runs: int
    failures: int
    settled: float  # share
    unsettled: float  # share of the rest
    effort: float  # median [m/s²] of all runs, failures worse than any: inf where half or more fail
    variation: float  # median [m/s²] in a second, so too

    @property
    def failed(self) -> float:
        """Share of the runs."""
        return self.failures / self.runs


def set_standings(
    benchmark: Benchmark, table: BenchmarkTable, division: Division, crane_set: str
) -> list[Standing]:
    """Of every law that has been run there, the fewest failures first, then the least unsettled."""
    shared = shared_scenarios(benchmark, table, division, crane_set)
    found = []
    for law in laws_of(table):
        places = [Trial(division, benchmark.plant, crane_set, scenario, law) for scenario in shared]
        if not places or not all(place in table.pieces for place in places):
            continue
        runs = [table.pieces[place] for place in places]
        durations = [float(table.about["durations"][place.scenario]) for place in places]
        settled = [scores.settled_share(r.metrics["settling_time_s"], r.failed) for r in runs]
        failed = np.concatenate([r.failed for r in runs])
        effort = np.concatenate([r.metrics[EFFORT] for r in runs])
        variation = np.concatenate([r.metrics[VARIATION] / t for r, t in zip(runs, durations, strict=True)])
        found.append(
            checked_standing(
                law,
                failed.size,
                int(failed.sum()),
                float(np.mean(settled)),
                float(np.mean([_unsettled(r, t) for r, t in zip(runs, durations, strict=True)])),
                scores.median_with_failures(effort, failed),
                scores.median_with_failures(variation, failed),
            )
        )
    return sorted(found, key=lambda each: (each.failed, each.unsettled))


def checked_standing(*fields: Any) -> Standing:
    """Return a standing; raises InconsistentError for counts and shares that contradict each other."""
    found = Standing(*fields)
    check_ascending(("failures", found.failures), (f"runs of {found.law}", found.runs))
    for name, share in (("settled", found.settled), ("unsettled", found.unsettled)):
        check_ascending(("zero", 0.0), (f"the share that {name}", share), ("one", 1.0), rounding=1e-12)
    return found


def shared_scenarios(
    benchmark: Benchmark, table: BenchmarkTable, division: Division, crane_set: str
) -> list[str]:
    """Scenarios that suit laws of every kind and on which any has been run."""
    there = {p.scenario for p in table.pieces if p[:3] == (division, benchmark.plant, crane_set)}
    return [name for name, each in benchmark.scenarios.items() if len(each.suits) > 1 and name in there]


def points_of(found: Sequence[Standing]) -> Array:
    """(laws, 3): unsettled share of the rest, effort, share of failures; the lower the better."""
    return np.array([[s.unsettled, s.effort, s.failed] for s in found])


def laws_of(table: BenchmarkTable) -> list[str]:
    """Names of all laws that have been run."""
    return list(dict.fromkeys(piece.law for piece in table.pieces))


def rest_time(runs: Runs, duration: float) -> float:
    """How long the path rests at its end [s], in runs of `duration`; all of it where no run came so far."""
    rest = runs.metrics["rest_s"]
    return duration - (float(np.nanmin(rest)) if np.isfinite(rest).any() else 0.0)


def _unsettled(runs: Runs, duration: float) -> float:
    return scores.unsettled_share(runs.metrics["settling_time_s"], runs.failed, rest_time(runs, duration))
