"""Plan random moves on the laboratory rig; half have an obstacle, a quarter have a via point.

    python validation/proofs/random_moves.py                    100 moves
    python validation/proofs/random_moves.py --seed 7 --runs 20

The exit code is 1 if a plan is slower than the shortest motion by the time law of degree 9, or if it exceeds
a limit at one of 100,000 samples. Set OPENBLAS_NUM_THREADS=1 to measure the time of one core.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cranectl.cli.output import Screen
from cranectl.metrics.clearance import clearance
from cranectl.planning import load_scenario, plan_motions
from cranectl.planning.limits import constraints, limits_of, motion
from cranectl.planning.plan import plan_move
from cranectl.planning.problem import ORDERS
from cranectl.reference import TimeLaw, Trajectory
from cranectl.reference.series import Series
from cranectl.reference.time_laws import spline
from cranectl.scenario import Scenario, Segment
from cranectl.scenario.planning import Obstacle
from cranectl.scenario.segments import Line, Move, Spline
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

SAMPLES = 100_000  # of a plan
ALLOWED_EXCESS = 2e-9  # over a limit, relative or in metres; twice the excess that a proof allows
MIN_DISTANCE = 0.1  # [m] from start to end


class Result(NamedTuple):
    """Result of planning one move."""

    outcome: str  # kind of the plan, or why there is none
    duration: float  # [s]; NaN if planning failed
    degree_9: float  # shortest duration by the time law of degree 9 [s]
    cpu_time: float  # [s]
    excess: float  # over the limit with the largest excess, relative or in metres

    @property
    def is_wrong(self) -> bool:
        """True if the plan is slower than the motion of degree 9, or exceeds a limit."""
        return self.duration > self.degree_9 * (1.0 + 1e-12) or self.excess > ALLOWED_EXCESS


def random_moves(seed: int) -> Iterator[Scenario]:
    """Yield an endless sequence of scenarios with one move each."""
    overrides = ["disturbances=[]", "reference.segments=[]", "duration=60.0"]
    base = load_scenario("fixed-position", overrides=overrides)
    limits = limits_of(base)
    k = 0
    while True:
        random = np.random.default_rng([seed, k])
        start, end, via = random.uniform(*limits.load.T, (3, 3))
        if np.linalg.norm(end - start) < MIN_DISTANCE:
            end = start + MIN_DISTANCE * np.sign(limits.load.mean(axis=1) - start)
        points = [start, *([via] if k % 4 == 2 else []), end]
        obstacles = [_obstacle(random, points, limits.radius)] if k % 2 else []
        move = Move(kind="move", to=tuple(end.tolist()), via=tuple(tuple(p.tolist()) for p in points[1:-1]))
        reference = base.reference.model_copy(update={"start": tuple(start.tolist()), "segments": (move,)})
        yield base.model_copy(
            update={"name": f"move-{k}", "reference": reference, "obstacles": tuple(obstacles)}
        )
        k += 1


def _obstacle(random: np.random.Generator, points: list[Array], radius: float) -> Obstacle:
    """Draw an obstacle that stands on the floor near the straight line, and contains none of the points."""
    while True:
        middle = points[0] + random.uniform(0.2, 0.8) * (points[-1] - points[0])
        half = random.uniform(0.05, 0.25, 3)
        middle[:2] += random.uniform(-0.2, 0.2, 2)
        low, high = middle - half, middle + half
        low[2], high[2] = -1.4, random.uniform(-1.2, -0.3)
        if not any(((point > low - 1.5 * radius) & (point < high + 1.5 * radius)).all() for point in points):
            return Obstacle(name="box", low=tuple(low.tolist()), high=tuple(high.tolist()))


def plan_and_check(scenario: Scenario) -> Result:
    """Plan the move of a scenario, and check the plan against all limits."""
    (move,) = scenario.reference.segments
    assert isinstance(move, Move)
    degree_9 = np.nan
    start = time.process_time()
    try:
        segments = plan_move(
            move, np.array(scenario.reference.start), scenario, "move"
        )  # never a stored plan
        cpu_time = time.process_time() - start
        shortest = plan_motions(_with_segments(scenario, move.model_copy(update={"duration": "shortest"})))
        degree_9 = sum(segment.seconds for segment in shortest.reference.segments)
    except InputError as error:
        return Result(f"refused: {error}", np.nan, degree_9, time.process_time() - start, 0.0)
    by_limit = excesses(_with_segments(scenario, *segments))
    worst = max(by_limit, key=lambda name: by_limit[name])
    outcome = "planned" if isinstance(segments[0], Spline) else f"degree 9, {len(segments)} lines"
    if by_limit[worst] > ALLOWED_EXCESS:
        outcome += f", but {worst} is exceeded"
    return Result(outcome, sum(segment.seconds for segment in segments), degree_9, cpu_time, by_limit[worst])


def _with_segments(scenario: Scenario, *segments: Segment) -> Scenario:
    reference = scenario.reference.model_copy(update={"segments": segments})
    return scenario.model_copy(update={"reference": reference})


def excesses(plan: Scenario, samples: int = SAMPLES) -> dict[str, float]:
    """Return the largest excess over each limit at samples of the plan, relative or in metres.

    A negative excess is a distance from the limit. The excess over an obstacle is the negative clearance, as
    the metrics of runs measure it.
    """
    limits = limits_of(plan)
    moved = motion(load_series(plan, samples), limits.gravity)
    by_limit = {
        c.name: float(np.maximum(c.series[0] - c.high, c.low - c.series[0]).max() / c.scale)
        for c in constraints(moved, limits)
    }
    load = np.stack([series[0] for series in moved.load], axis=1)
    trolley = np.stack([moved.axes[0][0], moved.axes[1][0], np.zeros(len(load))], axis=1)
    for box in limits.obstacles:
        by_limit[box.key] = -float(clearance(load, trolley, box.low, box.high, limits.radius).min())
    return by_limit


def load_series(plan: Scenario, samples: int) -> list[list[Array]]:
    """Return the Taylor series of the load by axis, at `samples` equidistant times of each segment."""
    tables, start = [], np.array(plan.reference.start)
    for segment in plan.reference.segments:
        times = np.linspace(0.0, segment.seconds, samples)
        if isinstance(segment, Spline):
            curve = spline(np.array(segment.breaks), np.array(segment.coefficients), segment.degree)
            tables.append([curve.derivative(k)(times) if k else curve(times) for k in range(ORDERS)])
        else:
            assert isinstance(segment, Line)
            law = TimeLaw().sample(times / times[-1], ORDERS) / times[-1] ** np.arange(ORDERS)[:, None]
            displacement = np.array(segment.to) - start
            tables.append([s[:, None] * displacement + (k == 0) * start for k, s in enumerate(law)])
        start = Trajectory.end_of(segment, start)
    values = np.concatenate(tables, axis=1)
    return [Series.from_derivatives(list(values[:, :, axis])) for axis in range(3)]


def main() -> int:
    """Plan and print all moves, with a summary; return 1 if a plan is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    results, screen = [], Screen()
    screen.print(f"{'':>4}{'T [s]':>9}{'degree 9':>10}{'CPU [s]':>9}{'excess':>10}  (* with an obstacle)")
    for k, scenario in enumerate(random_moves(options.seed)):
        if k >= options.first + options.runs:
            break
        if k < options.first:
            continue
        result = plan_and_check(scenario)
        results.append((bool(scenario.obstacles), result))
        mark = " WRONG" if result.is_wrong else ""
        screen.print(
            f"{k:3d}{'*' if scenario.obstacles else ' '}{result.duration:9.4f}{result.degree_9:10.4f}"
            f"{result.cpu_time:9.2f}{result.excess:10.1e}  {result.outcome}{mark}",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
    for title, group in (
        ("free", [r for has_obstacle, r in results if not has_obstacle]),
        ("with an obstacle", [r for has_obstacle, r in results if has_obstacle]),
        ("all", [r for _, r in results]),
    ):
        cpu_times = [r.cpu_time for r in group]
        ratios = [r.duration / r.degree_9 for r in group if r.duration == r.duration]
        if not ratios:
            continue
        by_nine = sum(r.outcome.startswith("degree 9") for r in group)
        refused = sum(r.outcome.startswith("refused") for r in group)
        screen.print(
            f"{title}: {len(group)}, CPU median {np.median(cpu_times):.2f} s, "
            f"95 % {np.quantile(cpu_times, 0.95):.2f} s, most {max(cpu_times):.2f} s; "
            f"T / degree 9 median {np.median(ratios):.3f}; {by_nine} by degree 9, {refused} refused",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
    return 1 if any(result.is_wrong for _, result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
