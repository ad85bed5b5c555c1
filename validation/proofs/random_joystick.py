"""Steer cranes of three sizes at random by a joystick, and check references and plants.

    python validation/proofs/random_joystick.py                    50 runs of a minute; the seed is the commit
    python validation/proofs/random_joystick.py --seed 3f2a91c --runs 1000

The exit code is 1 if a reference exceeds a limit, a run does not complete, or plants differ by more than
allowed.
"""

import argparse
import sys
from collections.abc import Iterator

import numpy as np

from cranectl.cases.case import Case
from cranectl.cases.validation import Validation
from cranectl.cases.workers import run_cases
from cranectl.cli.counts import Count
from cranectl.cli.output import Screen
from cranectl.model.flatness import states_and_inputs
from cranectl.planning import load_scenario
from cranectl.planning.limits import limits_of
from cranectl.scenario import Scenario
from cranectl.signals import ALPHA, BETA
from cranectl.simulate import PlannedReference
from cranectl.tools.live.hand import HandReference, HandRequest
from cranectl.tools.live.hand_limits import hand_limits
from validation.proofs.random_cranes import commit

CRANES = ("fixed-position", "workshop-move", "ship-to-shore")
STEERING_TIME = 60.0  # [s]
ALLOWED_EXCESS = 1e-9  # over a limit, relative, for rounding


def random_drives(seed: str, crane: str = "") -> Iterator[Scenario]:
    """Yield an endless sequence of scenarios with a minute of steering and the rest phase after it."""
    k = 0
    while True:
        random = np.random.default_rng([int(seed, 16), k])
        yield random_drive(random, crane or str(random.choice(CRANES)), f"joystick-{k}")
        k += 1


def random_drive(random: np.random.Generator, crane: str, name: str) -> Scenario:
    """Draw velocity commands of all sizes, reversals at full speed, and target points."""
    overrides = [
        "disturbances=[]",
        "reference.segments=[]",
        "limits={}",
        "workspace.on_exit='stop'",
        "duration=1.0",
    ]
    scenario = load_scenario(crane, overrides=[f"name='{name}'", *overrides])
    limits = hand_limits(scenario)
    start = random.uniform(limits.low, limits.high).tolist()
    reference = scenario.reference.model_copy(update={"start": tuple(start)})
    scenario = scenario.model_copy(update={"reference": reference})
    hand, sample = HandReference(scenario, 0), 0
    while sample * scenario.control.period < STEERING_TIME:
        kind = random.choice(["any", "full", "none", "point"], p=[0.4, 0.4, 0.1, 0.1])
        full = random.integers(-1, 2, 3) * limits.speed
        velocities = {"any": random.uniform(-limits.speed, limits.speed), "full": full, "none": np.zeros(3)}
        request = random.uniform(limits.low, limits.high) if kind == "point" else velocities[kind]
        hand.follow(sample, HandRequest(kind == "point", *request.tolist()))
        sample += int(np.ceil(random.exponential(1.5 / limits.bandwidth) / scenario.control.period))
    return hand.scenario(sample, "lqr")


def limit_usage(scenario: Scenario) -> dict[str, float]:
    """Return the part of each limit that the reference of a driven scenario uses; 1 is the limit."""
    reference = PlannedReference.of(scenario).reference  # raises an error if the path leaves the workspace
    states, inputs = states_and_inputs(reference, scenario.rig.gravity)
    limits = limits_of(scenario)
    setpoints = states[:, 1:6:2] + scenario.rig.time_constants * inputs
    rates = np.diff(setpoints, axis=0) / scenario.control.period
    lean = np.arccos(np.cos(states[:, ALPHA]) * np.cos(states[:, BETA]))
    low, high = scenario.rig.workspace.T
    middle, half = 0.5 * (low + high), 0.5 * (high - low) - scenario.planning.clearance
    return {
        "velocity": float(np.abs(setpoints / limits.velocity).max()),
        "acceleration": float(np.abs(rates / limits.acceleration).max()),
        "lean": float(np.tan(lean.max()) / limits.lean),
        "workspace": float((np.abs(states[:, :5:2] - middle) / half).max()),
    }


def case_of(scenario: Scenario) -> Case:
    """Return a case that compares two plants with the smallest limits."""
    return Case.of(
        scenario, controller="lqr", drive="ideal", plants=("analytic", "mujoco"), keep="none", pairwise=True
    )


def main() -> int:
    """Draw and run scenarios, and print violations; return 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seed", default=commit(), metavar="HEX")
    parser.add_argument("--runs", type=int, default=50)
    options = parser.parse_args()
    screen = Screen()
    screen.print(f"{options.runs} runs of a minute by hand, seed {options.seed}")
    drawn = random_drives(options.seed)
    scenarios = [next(drawn) for _ in range(options.runs)]
    usages = [limit_usage(scenario) for scenario in scenarios]
    largest = {limit: max(usage[limit] for usage in usages) for limit in usages[0]}
    parts = ", ".join(f"{limit} {part:.3f}" for limit, part in largest.items())
    screen.print(f"largest used part of each limit: {parts}")
    failed = sum(max(usage.values()) > 1.0 + ALLOWED_EXCESS for usage in usages)
    cases = tuple(map(case_of, scenarios))
    validation = Validation(cases, run_cases(cases, jobs=Count.available_cores()), {}, ())
    largest_difference = 0.0
    for case, result in validation.results:
        for pair in result.pairs:
            largest_difference = max(largest_difference, pair.agreement.max_load_error_m)
            if not pair.agreement.passed:
                failed += 1
                screen.print(f"{case.scenario.name}: {pair.agreement}")
    screen.print(f"plants differ by at most {largest_difference:.1e} m")
    for _, case, failure in validation.failures:
        screen.print(f"{case and case.scenario.name}: {failure.reason}")
    return 1 if failed or len(validation.finished) < len(validation.cases) else 0


if __name__ == "__main__":
    sys.exit(main())
