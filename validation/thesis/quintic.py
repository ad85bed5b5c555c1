"""Compare the tracking errors of a quintic and of the time law of degree 9 on the settled trajectory.

The tracker needs a reference in C⁴, but the quintic's third derivative jumps at both ends of a segment. The
load's third derivative cannot jump, so at each jump the third derivative of the error does. Then the error
follows the impulse response of 1 / (s⁴ + k_3 s³ + k_2 s² + k_1 s + k_0). So the largest error is its peak
times the largest jump. There are no disturbances.

    python validation/thesis/quintic.py
"""

from dataclasses import dataclass

import control
import numpy as np

from cranectl.design import design_controller
from cranectl.design.linear_systems import inner_loop
from cranectl.planning import load_scenario
from cranectl.reference import Trajectory
from cranectl.scenario import Scenario
from cranectl.simulate import simulate_run

CONTINUITY = {"degree-5": 2, "degree-9": 4}  # of the time laws


@dataclass(frozen=True)
class Cost:
    """Error and effort of a run with one time law."""

    max_error: float  # [m]
    max_acceleration: float  # of bridge and trolley [m/s²]
    max_jump: float  # of any input between two samples [m/s²]


def scenario(law: str) -> Scenario:
    """Return the settled trajectory with the time law `law`, without disturbances."""
    segments = [f"reference.segments.{k}.time_law='{law}'" for k in (0, 1)]
    return load_scenario(
        "settled-trajectory",
        overrides=[*segments, f"reference.continuity={CONTINUITY[law]}", "disturbances=[]"],
    )


def cost(law: str, controller: str, plant: str, drive: str) -> Cost:
    """Simulate the settled trajectory with one time law, and return its cost."""
    run = simulate_run(scenario(law), plant=plant, drive=drive, controller=controller)
    error = np.linalg.norm(run.reference[:, :3] - run.load_position, axis=1)
    inputs = run.block("input")[:, :3]
    return Cost(
        max_error=float(error.max()),
        max_acceleration=float(np.abs(inputs[:, :2]).max()),
        max_jump=float(np.abs(np.diff(inputs, axis=0)).max()),
    )


def predicted_error(feedback: str) -> float:
    """Predict the largest error of plain feedback with the quintic [m], without a simulation."""
    settings = scenario("degree-5").reference
    ends = np.cumsum([0.0, *(segment.duration for segment in settings.segments)])
    instants = np.array([ends - 1e-6, ends + 1e-6]).clip(min=0.0)
    before, after = (Trajectory.of(settings).sample(times)[:, 9:12] for times in instants)
    before[0] = 0.0  # at rest before the start
    jump = np.linalg.norm(after - before, axis=1).max()
    response = control.impulse_response(inner_loop(design_controller(feedback).gain), np.linspace(0, 8, 4001))
    return float(jump * np.abs(response.outputs).max())


if __name__ == "__main__":
    for feedback in ("pole-placement", "lqr"):
        print(f"{feedback}, quintic: predicted largest error {1e3 * predicted_error(feedback):.2f} mm")
    print(
        "controller, drives, plant: largest error [mm], largest acceleration, largest jump of an input [m/s²]"
    )
    for name in ("pole-placement", "lqr", "lqr+hinf", "lqr+loop-shaping"):
        for drives in ("ideal", "velocity"):
            for plant in ("analytic", "mujoco"):
                costs = [cost(law, name, plant, drives) for law in CONTINUITY]
                texts = (
                    f"{1e3 * c.max_error:.2f}, {c.max_acceleration:.3f}, {c.max_jump:.4f}" for c in costs
                )
                print(f"{name}, {drives}, {plant}: " + " | ".join(texts))
