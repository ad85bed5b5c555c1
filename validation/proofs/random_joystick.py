"""A joystick that nobody holds with care, on cranes of three sizes: what it asks, whether plants bear it.

    python validation/proofs/random_joystick.py                    50 runs of a minute; the seed is the commit
    python validation/proofs/random_joystick.py --seed 3f2a91c --runs 1000

Exit code 1 if a reference leaves its limits, a run does not complete, or plants differ by more than theirs.
"""

import argparse
import sys
from collections.abc import Iterator

import numpy as np

from cranectl.cases.case import Case, make_case
from cranectl.cases.validation import Validation
from cranectl.cases.workers import available_cores, run_cases
from cranectl.cli.output import Screen
from cranectl.live.hand import Hand, HandRequest
from cranectl.live.hand_limits import hand_limits
from cranectl.model.flatness import states_and_inputs
from cranectl.planning import load_scenario
from cranectl.planning.limits import limits_of
from cranectl.scenario import Scenario
from cranectl.signals import ALPHA, BETA
from cranectl.simulate import plan_reference
from validation.proofs.random_cranes import commit

CRANES = ("fixed-position", "workshop-move", "ship-to-shore")
MINUTE = 60.0  # [s]
ROUNDING = 1e-9


def random_drives(seed: str, crane: str = "") -> Iterator[Scenario]:
    """Yield scenarios without end, each a minute of steering by hand and the rest that follows."""
    k = 0
    while True:
        random = np.random.default_rng([int(seed, 16), k])
        yield random_drive(random, crane or str(random.choice(CRANES)), f"joystick-{k}")
        k += 1


def random_drive(random: np.random.Generator, crane: str, name: str) -> Scenario:
    """Draw velocity commands of all sizes, reversals at full speed, and points to go to."""
    bare = [
        "disturbances=[]",
        "reference.segments=[]",
        "limits={}",
        "workspace.on_exit='stop'",
        "duration=1.0",
    ]
    scenario = load_scenario(crane, overrides=[f"name='{name}'", *bare])
    limits = hand_limits(scenario)
    start = random.uniform(limits.low, limits.high).tolist()
    reference = scenario.reference.model_copy(update={"start": tuple(start)})
    scenario = scenario.model_copy(update={"reference": reference})
    hand, sample = Hand(scenario, 0), 0
    while sample * scenario.control.period < MINUTE:
        kind = random.choice(["any", "full", "none", "point"], p=[0.4, 0.4, 0.1, 0.1])
        full = random.integers(-1, 2, 3) * limits.speed
        wish = {"any": random.uniform(-limits.speed, limits.speed), "full": full, "none": np.zeros(3)}
        asked = random.uniform(limits.low, limits.high) if kind == "point" else wish[kind]
        hand.ask(sample, HandRequest(kind == "point", *asked.tolist()))
        sample += int(np.ceil(random.exponential(1.5 / limits.bandwidth) / scenario.control.period))
    return hand.scenario(sample, "lqr")


def load_of_limits(scenario: Scenario) -> dict[str, float]:
    """Return how much of each limit the reference of a driven scenario needs; 1 is all of its share."""
    reference = plan_reference(scenario).reference  # which refuses what leaves the workspace
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
    """Return a case of plants that must agree as closely as any."""
    return make_case(
        scenario, controller="lqr", drive="ideal", plants=("analytic", "mujoco"), keep="none", pairwise=True
    )


def main() -> int:
    """Draw, run, judge, say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seed", default=commit(), metavar="HEX")
    parser.add_argument("--runs", type=int, default=50)
    options = parser.parse_args()
    say = Screen().print
    say(f"{options.runs} runs of a minute by hand, seed {options.seed}")
    drawn = random_drives(options.seed)
    scenarios = [next(drawn) for _ in range(options.runs)]
    loads = [load_of_limits(scenario) for scenario in scenarios]
    most = {limit: max(load[limit] for load in loads) for limit in loads[0]}
    say("of the limits at most: " + ", ".join(f"{limit} {load:.3f}" for limit, load in most.items()))
    failed = sum(max(load.values()) > 1.0 + ROUNDING for load in loads)
    cases = tuple(map(case_of, scenarios))
    validation = Validation(cases, run_cases(cases, jobs=available_cores()), {}, ())
    farthest = 0.0
    for case, result in validation.results:
        for pair in result.pairs:
            farthest = max(farthest, pair.agreement.max_load_error_m)
            if not pair.agreement.passed:
                failed += 1
                say(f"{case.scenario.name}: {pair.agreement}")
    say(f"plants differ by {farthest:.1e} m at most")
    for _, case, failure in validation.failures:
        say(f"{case and case.scenario.name}: {failure.reason}")
    return 1 if failed or validation.failures or validation.lost else 0


if __name__ == "__main__":
    sys.exit(main())
