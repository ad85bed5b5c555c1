"""What finer knots would gain: a plan beside the one with twice as many, and what ever finer ones tend to."""

from pathlib import Path

from cranectl.planning import planned
from cranectl.scenario import Scenario
from cranectl.scenario.segments import seconds


def least_durations(plan: Scenario, asked: Scenario, directory: Path = Path()) -> tuple[float, ...]:
    """Of each segment of the `plan` of what is `asked` for, [s]: with 2 n knot spans, T(2n) - (T(n) - T(2n)).

    What knots cost falls as 1/n, so this is near the shortest motion of all, whose drives' accelerations
    jump: measured 0.3 % above it, 1.5 % over an obstacle (docs/explanation/planning.md). An estimate, since
    each plan is the best near its guess. Raises InputError for what cannot be planned.
    """
    finer = asked.planning.model_copy(update={"refinement": 2 * asked.planning.refinement})
    plans = plan, planned(asked.model_copy(update={"planning": finer}), directory)
    coarse, fine = ([seconds(segment) for segment in each.reference.segments] for each in plans)
    if len(coarse) != len(fine):  # one of them stops on its way
        return (float("nan"),) * len(coarse)
    return tuple(2.0 * b - a for a, b in zip(coarse, fine, strict=True))
