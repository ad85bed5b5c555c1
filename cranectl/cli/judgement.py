"""The plants of a log, judged as the run that wrote it was."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cranectl.compare.limits import Limits, NoLimits, Predict
    from cranectl.simulate import Run


def predictor(*, wanted: bool) -> "Predict | None":
    """What finds the limits of scenarios that are not shipped; loaded only where wanted, it takes time."""
    if not wanted:
        return None
    from cranectl.analysis.budget.predicted_limits import predicted_limits

    return predicted_limits


def limits_of(runs: "Sequence[Run]", *, predict: bool) -> "Limits | NoLimits":
    """The limits of the agreement of `runs`, those of one log."""
    from cranectl.compare.limits import limits_for

    first, plants = runs[0], [run.plant for run in runs]
    return limits_for(first.scenario, first.design, first.drive, plants, predict=predictor(wanted=predict))
