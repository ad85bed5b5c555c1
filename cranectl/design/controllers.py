"""The registry of controllers, FEEDBACK or FEEDBACK+ROBUSTIFIER, and the one way to design them."""

import functools
from typing import TYPE_CHECKING

import numpy as np

from cranectl.design.record import NO_ROBUSTIFIER, Design, Robustifier
from cranectl.errors import unknown_name
from cranectl.scenario import DesignSettings

if TYPE_CHECKING:
    import control

FEEDBACKS = ("pole-placement", "lqr")
ROBUSTIFIERS = ("hinf", "loop-shaping")
CONTROLLERS = tuple(
    f"{feedback}{suffix}" for feedback in FEEDBACKS for suffix in ("", *(f"+{r}" for r in ROBUSTIFIERS))
)


def checked_controller(name: str) -> str:
    """`name` if it is in `CONTROLLERS`; raises InputError that lists the known names otherwise."""
    if name not in CONTROLLERS:
        raise unknown_name("controller", name, CONTROLLERS)
    return name


@functools.lru_cache(maxsize=64)
def design_controller(name: str, settings: DesignSettings | None = None) -> Design:
    """Design the controller `name` for one axis.

    Raises InputError for a name not in `CONTROLLERS` and for settings that no controller can meet.
    """
    feedback_name, _, robustifier_name = checked_controller(name).partition("+")
    from cranectl.design import state_feedback  # python-control takes most of a second to import

    settings = settings or DesignSettings()
    gains = {"pole-placement": state_feedback.pole_placement_gain, "lqr": state_feedback.lqr_gain}
    gain = gains[feedback_name](settings)
    robustifier, gamma, achieved = _robustifier(robustifier_name, gain, settings)
    return _record(name, gain, robustifier, gamma, achieved)


def _robustifier(
    name: str, gain: np.ndarray, settings: DesignSettings
) -> tuple["control.StateSpace", float | None, float | None]:
    """(system from e to v-bar, smallest gamma, its gamma)."""
    if name == "hinf":
        from cranectl.design.mixed_sensitivity import hinf_robustifier

        return hinf_robustifier(gain, settings.hinf)
    if name == "loop-shaping":
        from cranectl.design.loop_shaping import loop_shaping_robustifier

        return loop_shaping_robustifier(gain, settings.loop_shaping)
    import control

    return control.ss([], [], [], [[0.0]]), None, None


def _record(
    name: str,
    gain: np.ndarray,
    robustifier: "control.StateSpace",
    gamma: float | None,
    achieved: float | None,
) -> Design:
    from cranectl.design.loop import closed_loop_poles, loop_margins, open_loop
    from cranectl.design.modal import real_modal_form

    loop = open_loop(gain, robustifier)
    modal = real_modal_form(robustifier)
    record = Robustifier(modal.A, modal.B.ravel(), modal.C.ravel(), float(modal.D[0, 0]))
    return Design(
        name=name,
        gain=gain,
        closed_loop_poles=closed_loop_poles(loop),
        margins=loop_margins(loop),
        robustifier=record if record.order else NO_ROBUSTIFIER,
        gamma=gamma,
        gamma_achieved=achieved,
        stability_margin=1.0 / achieved if achieved is not None and name.endswith("loop-shaping") else None,
    )
