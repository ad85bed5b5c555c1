"""Random moves on the laboratory's rig, half of them with an obstacle, a quarter through a point: how good.

    python validation/proofs/random_moves.py                    100 moves
    python validation/proofs/random_moves.py --seed 7 --runs 20

Exit code 1 if a plan is slower than the shortest motion by the law of degree 9, or breaks a limit at one of
100,000 samples. Set OPENBLAS_NUM_THREADS=1 for times of one core.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cranectl.cli.output import Screen
from cranectl.metrics.clearance import clearance
from cranectl.planning import load_scenario, planned
from cranectl.planning.limits import constraints, limits_of, motion
from cranectl.planning.plan import plan_move
from cranectl.planning.problem import ORDERS
from cranectl.reference import end_point, time_law
from cranectl.reference.series import from_derivatives
from cranectl.reference.time_laws import spline
from cranectl.scenario import Scenario, Segment
from cranectl.scenario.planning import Obstacle
from cranectl.scenario.segments import Line, Move, Spline, seconds
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

SAMPLES = 100_000
ROUNDING = 2e-9  # of a limit or in metres: twice what a proof lets pass
FAR = 0.1  # least way [m]


class Result(NamedTuple):
    """Of one move."""

    told: str  # what came of it
    duration: float  # [s], NaN where it was refused
    shortest: float  # by the law of degree 9 [s]
    seconds: float  # of this processor
    excess: float  # over the limit that is broken most, in parts of it or in metres


def random_moves(seed: int) -> Iterator[Scenario]:
    """Yield scenarios without end, each of one move."""
    bare = ["disturbances=[]", "reference.segments=[]", "duration=60.0"]
    base = load_scenario("fixed-position", overrides=bare)
    limits = limits_of(base)
    k = 0
    while True:
        random = np.random.default_rng([seed, k])
        start, end, via = random.uniform(*limits.load.T, (3, 3))
        if np.linalg.norm(end - start) < FAR:
            end = start + FAR * np.sign(limits.load.mean(axis=1) - start)
        points = [start, *([via] if k % 4 == 2 else []), end]
        obstacles = [_obstacle(random, points, limits.radius)] if k % 2 else []
        move = Move(kind="move", to=tuple(end.tolist()), via=tuple(tuple(p.tolist()) for p in points[1:-1]))
        reference = base.reference.model_copy(update={"start": tuple(start.tolist()), "segments": (move,)})
        yield base.model_copy(
            update={"name": f"move-{k}", "reference": reference, "obstacles": tuple(obstacles)}
        )
        k += 1


def _obstacle(random: np.random.Generator, points: list[Array], radius: float) -> Obstacle:
    """Draw an obstacle near the straight line, from the floor up, that leaves the points outside."""
    while True:
        middle = points[0] + random.uniform(0.2, 0.8) * (points[-1] - points[0])
        half = random.uniform(0.05, 0.25, 3)
        middle[:2] += random.uniform(-0.2, 0.2, 2)
        low, high = middle - half, middle + half
        low[2], high[2] = -1.4, random.uniform(-1.2, -0.3)
        if not any(((point > low - 1.5 * radius) & (point < high + 1.5 * radius)).all() for point in points):
            return Obstacle(name="box", low=tuple(low.tolist()), high=tuple(high.tolist()))


def result(scenario: Scenario) -> Result:
    """Plan it."""
    (move,) = scenario.reference.segments
    assert isinstance(move, Move)
    shortest = np.nan
    begun = time.process_time()
    try:
        ready = plan_move(move, np.array(scenario.reference.start), scenario, "move")  # never a kept plan
        spent = time.process_time() - begun
        nine = planned(_with(scenario, move.model_copy(update={"duration": "shortest"})))
        shortest = sum(map(seconds, nine.reference.segments))
    except InputError as error:
        return Result(f"refused: {error}", np.nan, shortest, time.process_time() - begun, 0.0)
    found = excesses(_with(scenario, *ready))
    worst = max(found, key=lambda name: found[name])
    told = "planned" if isinstance(ready[0], Spline) else f"degree 9, {len(ready)} lines"
    if found[worst] > ROUNDING:
        told += f", but {worst} is exceeded"
    return Result(told, sum(map(seconds, ready)), shortest, spent, found[worst])


def _with(scenario: Scenario, *segments: Segment) -> Scenario:
    reference = scenario.reference.model_copy(update={"segments": segments})
    return scenario.model_copy(update={"reference": reference})


def excesses(plan: Scenario, samples: int = SAMPLES) -> dict[str, float]:
    """Return the largest excess over each limit, relative or in metres, at samples of the plan.

    Obstacles are measured as in runs; a negative excess is a distance.

    Of obstacles as runs are measured; negative: what is left.
    """
    limits = limits_of(plan)
    moved = motion(jets(plan, samples), limits.gravity)
    found = {
        each.name: float(np.maximum(each.series[0] - each.high, each.low - each.series[0]).max() / each.scale)
        for each in constraints(moved, limits)
    }
    load = np.stack([series[0] for series in moved.load], axis=1)
    trolley = np.stack([moved.axes[0][0], moved.axes[1][0], np.zeros(len(load))], axis=1)
    for box in limits.obstacles:
        found[box.key] = -float(clearance(load, trolley, box.low, box.high, limits.radius).min())
    return found


def jets(plan: Scenario, samples: int) -> list[list[Array]]:
    """Return series of the load at equal distances of time, of each segment."""
    tables, here = [], np.array(plan.reference.start)
    for segment in plan.reference.segments:
        when = np.linspace(0.0, seconds(segment), samples)
        if isinstance(segment, Spline):
            curve = spline(np.array(segment.breaks), np.array(segment.coefficients), segment.degree)
            tables.append([curve.derivative(k)(when) if k else curve(when) for k in range(ORDERS)])
        else:
            assert isinstance(segment, Line)
            law = time_law("degree-9", when / when[-1], ORDERS) / when[-1] ** np.arange(ORDERS)[:, None]
            way = np.array(segment.to) - here
            tables.append([s[:, None] * way + (k == 0) * here for k, s in enumerate(law)])
        here = end_point(segment, here)
    values = np.concatenate(tables, axis=1)
    return [from_derivatives(list(values[:, :, axis])) for axis in range(3)]


def main() -> int:
    """Print all, and what they have in common."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    bad, done, screen = 0, [], Screen()
    screen.print(f"{'':>4}{'T [s]':>9}{'degree 9':>10}{'CPU [s]':>9}{'excess':>10}  (* with an obstacle)")
    for k, scenario in enumerate(random_moves(options.seed)):
        if k >= options.first + options.runs:
            break
        if k < options.first:
            continue
        found = result(scenario)
        wrong = found.duration > found.shortest * (1.0 + 1e-12) or found.excess > ROUNDING
        bad += wrong
        done.append((bool(scenario.obstacles), found))
        screen.print(
            f"{k:3d}{'*' if scenario.obstacles else ' '}{found.duration:9.4f}{found.shortest:10.4f}"
            f"{found.seconds:9.2f}{found.excess:10.1e}  {found.told}{' WRONG' if wrong else ''}",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
    for title, chosen in (
        ("free", [f for wall, f in done if not wall]),
        ("with an obstacle", [f for wall, f in done if wall]),
        ("all", [f for _, f in done]),
    ):
        spent = [f.seconds for f in chosen]
        ratio = [f.duration / f.shortest for f in chosen if f.duration == f.duration]
        if not ratio:
            continue
        by_nine = sum(f.told.startswith("degree 9") for f in chosen)
        refused = sum(f.told.startswith("refused") for f in chosen)
        screen.print(
            f"{title}: {len(chosen)}, CPU median {np.median(spent):.2f} s, "
            f"95 % {np.quantile(spent, 0.95):.2f} s, most {max(spent):.2f} s; "
            f"T / degree 9 median {np.median(ratio):.3f}; {by_nine} by degree 9, {refused} refused",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
