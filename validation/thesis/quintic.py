"""What a quintic costs where C⁴ is needed: the settled trajectory, undisturbed, with both time laws.

The quintic's third derivative jumps at both ends of a segment. The tracker's z-dot-dot-dot cannot jump with
it, so the error starts anew with e-dot-dot-dot = the jump, and follows the impulse response of
1 / (s⁴ + k_3 s³ + k_2 s² + k_1 s + k_0): its peak times the largest jump is the peak of the error.

    python validation/thesis/quintic.py
"""

from dataclasses import dataclass

import control
import numpy as np

from cranectl.design import design_controller
from cranectl.design.linear_systems import inner_loop
from cranectl.planning import load_scenario
from cranectl.reference import build_trajectory
from cranectl.scenario import Scenario
from cranectl.simulate import simulate_run

LAWS = {"degree-5": 2, "degree-9": 4}  # and the continuity they have


@dataclass(frozen=True)
class Cost:
    """What one run along one time law needs."""

    max_error: float  # [m]
    max_acceleration: float  # of bridge and trolley [m/s²]
    max_jump: float  # of any input from one sample to the next [m/s²]


def scenario(law: str) -> Scenario:
    """Return the settled trajectory along `law`, without disturbances."""
    laws = [f"reference.segments.{k}.time_law='{law}'" for k in (0, 1)]
    return load_scenario(
        "settled-trajectory", overrides=[*laws, f"reference.continuity={LAWS[law]}", "disturbances=[]"]
    )


def cost(law: str, controller: str, plant: str, drive: str) -> Cost:
    """Run it."""
    run = simulate_run(scenario(law), plant=plant, drive=drive, controller=controller)
    error = np.linalg.norm(run.reference[:, :3] - run.load_position, axis=1)
    inputs = run.block("input")[:, :3]
    return Cost(
        max_error=float(error.max()),
        max_acceleration=float(np.abs(inputs[:, :2]).max()),
        max_jump=float(np.abs(np.diff(inputs, axis=0)).max()),
    )


def predicted_error(feedback: str) -> float:
    """Predict the peak error of plain feedback along the quintic [m], without a run."""
    settings = scenario("degree-5").reference
    ends = np.cumsum([0.0, *(segment.duration for segment in settings.segments)])
    instants = np.array([ends - 1e-6, ends + 1e-6]).clip(min=0.0)
    before, after = (build_trajectory(settings).sample(times)[:, 9:12] for times in instants)
    before[0] = 0.0  # at rest before the start
    jump = np.linalg.norm(after - before, axis=1).max()
    response = control.impulse_response(inner_loop(design_controller(feedback).gain), np.linspace(0, 8, 4001))
    return float(jump * np.abs(response.outputs).max())


if __name__ == "__main__":
    for feedback in ("pole-placement", "lqr"):
        print(f"{feedback}, quintic: predicted peak error {1e3 * predicted_error(feedback):.2f} mm")
    print("controller, drives, plant: max error [mm], peak acceleration, largest jump of an input [m/s²]")
    for name in ("pole-placement", "lqr", "lqr+hinf", "lqr+loop-shaping"):
        for drives in ("ideal", "velocity"):
            for crane in ("analytic", "mujoco"):
                found = [cost(law, name, crane, drives) for law in LAWS]
                texts = (
                    f"{1e3 * c.max_error:.2f}, {c.max_acceleration:.3f}, {c.max_jump:.4f}" for c in found
                )
                print(f"{name}, {drives}, {crane}: " + " | ".join(texts))
