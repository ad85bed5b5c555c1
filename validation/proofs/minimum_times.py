"""Print the tables of docs/explanation/planning.md: motions in minimum time, and their closed loops.

    python validation/proofs/minimum_times.py

The first table compares durations of four moves at 98 % of the limits: the shortest motion by the time law of
degree 9, input shapers by formula, the plan, and a lower bound by another transcription. `make extras`
installs CasADi for the bound. The second table shows plans with other shares of the limits, under LQR with
velocity drives that saturate, without and with sensing, delay and friction.
"""

from math import pi, sqrt

import numpy as np

from cranectl.metrics import RunMetrics, run_metrics
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.simulate import simulate_run

WALL = "obstacles=[{name='wall', low=[0.8, 0.0, -1.4], high=[1.2, 1.54, -0.6]}]"
TURN = "{kind='arc', centre=[1.0, 0.77], angle=-6.283185307179586, %s}"
CASES = {  # by name: start, segments with %s for their timing, and further settings
    "a: 1 m along x": ("[0.5,0.77,-0.7]", ["{kind='move', to=[1.5,0.77,-0.7]%s}"], ()),
    "b: hoisting diagonal": ("[0.4,0.4,-0.9]", ["{kind='move', to=[1.6,1.0,-0.6]%s}"], ()),
    "c: over a wall": ("[0.4,0.77,-1.1]", ["{kind='move', to=[1.6,0.77,-1.1]%s}"], (WALL,)),
    "d: the thesis's path": ("[0.1,0.1,-0.15]", ["{kind='line', to=[1.65,0.77,-0.7], %s}", TURN], ()),
}
ROUGH_EFFECTS = ("effects.sensing={}", "effects.delay={}", "effects.friction={}")
NO_FORCE_LIMITS = "effects.limits={force=[1e9,1e9,1e9]}"  # because the analytic plant has none


def scenario(case: str, *settings: str, shortest: bool = False) -> Scenario:
    """Return the planned scenario of a case; `shortest` selects the time law of degree 9."""
    start, segments, more = CASES[case]
    timed = {"m": ", duration='shortest'" if shortest else ""}
    timed["l"] = timed["a"] = "duration='shortest'" if shortest else "time_law='minimum-time'"
    texts = ", ".join(text % timed[text[7]] for text in segments)
    path = (f"reference.start={start}", f"reference.segments=[{texts}]", "duration=20", "disturbances=[]")
    return load_scenario("fixed-position", overrides=[*path, *more, *settings])


def simulate_plan(plan: Scenario, plant: str) -> RunMetrics:
    """Simulate a plan under LQR with velocity drives, and return the metrics."""
    metrics = run_metrics(simulate_run(plan, plant=plant, drive="velocity", controller="lqr"))
    assert metrics is not None
    return metrics


def duration(plan: Scenario) -> float:
    """Return the duration of all segments [s]."""
    return sum(float(segment.duration) for segment in plan.reference.segments)


def main() -> None:
    """Print both tables."""
    from tests.planning.bang_bang import CASES as BOUNDED
    from tests.planning.bang_bang import Limits, bound

    settings = ("planning.share=0.98", "control.lag_compensation=false")
    shaped = {"a: 1 m along x": [1.25 + part * 2.0 * pi * sqrt(0.7 / 9.81) for part in (0.5, 1.0)]}
    bound_cases = {"a": ("a",), "b": ("b",), "c": ("c, load of 0.05 m",), "d": ("d, line", "d, turn")}
    print(f"{'case':22} {'degree 9':>9} {'ZV':>6} {'ZVD':>6} {'planned':>8} {'bound':>7} {'ratio':>6}")
    for case in CASES:
        degree_9 = duration(scenario(case, *settings, shortest=True))
        planned = duration(scenario(case, *settings))
        shapers = " ".join(f"{value:6.2f}" for value in shaped.get(case, (np.nan, np.nan)))
        least = sum(bound(BOUNDED[name], Limits()) for name in bound_cases[case[0]])
        numbers = f"{planned:8.3f} {least:7.3f} {planned / least:6.3f}"
        print(f"{case:22} {degree_9:9.3f} {shapers} {numbers}", flush=True)
    headings = f"{'effects':8} {'share':>5} {'T [s]':>6} {'plant':9} {'error [mm]':>10} {'saturated [s]':>13}"
    print(f"\n{'case':22} {headings}")
    for case in CASES:
        for effects, share in (
            ((), 0.95),
            (ROUGH_EFFECTS, 0.95),
            (ROUGH_EFFECTS, 0.9),
            (ROUGH_EFFECTS, 0.88),
        ):
            plan = scenario(case, NO_FORCE_LIMITS, *effects, f"planning.share={share}")
            for plant in ("elastic", "mujoco") if effects else ("analytic", "elastic", "mujoco"):
                metrics = simulate_plan(plan, plant)
                kind = "rough" if effects else "limits"
                row = f"{case:22} {kind:8} {share:5.2f} {duration(plan):6.3f} {plant:9}"
                print(f"{row} {1e3 * metrics.max_error_m:10.2f} {metrics.saturated_s:13.3f}", flush=True)


if __name__ == "__main__":
    main()
