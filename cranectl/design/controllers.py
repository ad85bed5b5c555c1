"""The registry of controllers, FEEDBACK or FEEDBACK+ROBUSTIFIER, and the one way to design them."""

import functools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cranectl.design.kept import kept_design
from cranectl.design.records import NO_ROBUSTIFIER, Design, Robustifier
from cranectl.scenario import DesignSettings
from cranectl.support.errors import InputError, unknown_name

if TYPE_CHECKING:
    import control

FEEDBACKS = ("pole-placement", "lqr")
ROBUSTIFIERS = ("hinf", "loop-shaping")
BY_HAND = ", gains by hand"  # follows the name of a design whose gains were changed
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
    settings = settings or DesignSettings()
    return kept_design(checked_controller(name), settings, lambda: _computed(name, settings))


def _computed(name: str, settings: DesignSettings) -> Design:
    from cranectl.design import state_feedback  # python-control takes more than a second to import

    feedback_name, _, robustifier_name = name.partition("+")
    gains = {"pole-placement": state_feedback.pole_placement_gain, "lqr": state_feedback.lqr_gain}
    gain = gains[feedback_name](settings)
    robustifier, gamma, achieved = _robustifier(robustifier_name, gain, settings)
    return _record(name, gain, robustifier, gamma, achieved)


def with_gain(design: Design, gain: np.ndarray) -> Design:
    """`design` with another state feedback (4,) and the same robustifier, its poles and margins anew.

    Raises InputError if the loop of an axis is unstable.
    """
    import control

    from cranectl.design.margins import closed_loop_poles, open_loop

    r = design.robustifier
    robustifier = control.ss(r.a, r.b.reshape(-1, 1), r.c.reshape(1, -1), r.d)
    fastest = closed_loop_poles(open_loop(gain, robustifier)).real.max()
    if not fastest < 0.0:
        raise InputError(
            f"unstable with the gains {', '.join(f'{k:g}' for k in gain)}: a pole at {fastest:.3g} 1/s",
            allowed="gains that put all poles of the closed loop to the left",
            remedy="change k3, k2, k1, k0 in this order when raising them, or all at once",
        )
    name = f"{design.name.removesuffix(BY_HAND)}{BY_HAND}"
    return replace(_record(name, gain, robustifier, None, None), robustifier=r)


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
    from cranectl.design.margins import closed_loop_poles, loop_margins, open_loop
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
