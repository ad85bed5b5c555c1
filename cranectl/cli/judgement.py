"""The two plants of a log, judged as the run that wrote it was."""

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


def limits_of(run: "Run", *, predict: bool) -> "Limits | NoLimits":
    """The limits of the plants' agreement in the scenario of `run`."""
    from cranectl.compare.limits import limits_for

    return limits_for(run.scenario, run.design, run.drive, predict=predictor(wanted=predict))
