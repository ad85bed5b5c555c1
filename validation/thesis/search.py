"""Find the reading of the settled trajectory that reproduces Table 5.3 best, over all controllers.

    python validation/thesis/search.py              all readings, about two minutes
    python validation/thesis/search.py --best 30

A reading has these numbers: the end of the line; radius, sense and angle of the arc; time laws of both. Its
score is the mean relative deviation of peak accelerations from the bridge and trolley columns of Table 5.3. A
reading is impossible if its path leaves the rig, or if a run stops.
"""

import argparse
import itertools
import math
import sys
import tomllib
from dataclasses import dataclass

import numpy as np

from cranectl.design import design_controller
from cranectl.planning import load_scenario
from cranectl.simulate import Plan, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from cranectl.support.resources import Shipped

END_Y, END_Z = 0.77, -0.7  # [m] of the line
TIME_LAWS = ("degree-5", "degree-9")


@dataclass(frozen=True)
class Reading:
    """One reading of section 5.2.2."""

    end_x: float  # of the line [m]
    radius: float  # [m]; the centre lies between the line's end and the middle of the rig
    half_turns: int  # positive counter-clockwise from above
    line_law: str
    arc_law: str

    @property
    def centre_x(self) -> float:
        return self.end_x - self.radius if self.end_x > 1.0 else self.end_x + self.radius

    def overrides(self) -> list[str]:
        """Return settings of the scenario settled-trajectory, as of `--set`."""
        line = f"to=[{self.end_x}, {END_Y}, {END_Z}], time_law='{self.line_law}'"
        arc = (
            f"centre=[{self.centre_x}, {END_Y}], angle={self.half_turns * math.pi}, time_law='{self.arc_law}'"
        )
        segments = f"{{kind='line', duration=10.0, {line}}}, {{kind='arc', duration=10.0, {arc}}}"
        return [f"reference.segments=[{segments}]", "duration=20"]


CHOSEN = Reading(1.65, 0.65, -2, "degree-5", "degree-5")


def readings() -> list[Reading]:
    """Return all readings: ends from the text, radii that stay on the rig, half and full turns."""
    radii, half_turns = (0.35, 0.45, 0.525, 0.6, 0.65, 0.7), (-2, -1, 1, 2)
    combinations = itertools.product((0.6, 1.65), radii, half_turns, TIME_LAWS, TIME_LAWS)
    return [Reading(*values) for values in combinations]


def printed() -> dict[str, np.ndarray]:
    """Return the bridge and trolley columns of Table 5.3 by controller."""
    tables = tomllib.loads((Shipped.THESIS_FOLDER / "printed.toml").read_text(encoding="utf-8"))
    return {name: np.array(row[:2]) for name, row in tables["tables"]["5.3"]["rows"].items()}


def deviations(reading: Reading) -> np.ndarray | None:
    """Return relative deviations (controllers, 2) from Table 5.3, or None if the reading is impossible."""
    try:
        scenario = load_scenario("settled-trajectory", overrides=reading.overrides())
        plan = Plan.of(scenario)
    except InputError:
        return None
    rows = []
    for controller, row in printed().items():
        design = design_controller(controller, scenario.design)
        run = simulate_run(scenario, plant="analytic", design=design, plan=plan)
        if run.status != RunStatus.COMPLETED:
            return None
        rows.append(run.block("input")[:, :2].max(axis=0) / row - 1.0)
    return np.array(rows)


def main() -> int:
    """Print the best readings."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--best", type=int, default=12, metavar="N")
    arguments = parser.parse_args()
    scored, impossible = [], 0
    candidates = readings()
    for k, reading in enumerate(candidates, start=1):
        errors = deviations(reading)
        if errors is None:
            impossible += 1
        else:
            mean = np.abs(errors).mean(axis=0)
            scored.append((float(mean.mean()), float(mean[0]), float(mean[1]), reading))
        if k % 24 == 0:
            print(f"{k} of {len(candidates)}", file=sys.stderr)
    scored.sort(key=lambda entry: entry[0])
    print(f"{len(candidates)} readings, {impossible} impossible on this rig")
    print(f"{'mean':>7} {'x':>7} {'y':>7}  end_x radius half-turns line arc")
    for total, x, y, r in scored[: arguments.best]:
        mark = "  <- chosen" if r == CHOSEN else ""
        print(
            f"{total:7.2%} {x:7.2%} {y:7.2%}  {r.end_x:5g} {r.radius:6g} {r.half_turns:10d} "
            f"{r.line_law} {r.arc_law}{mark}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
