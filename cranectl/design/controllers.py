"""Design a controller of the flat family.

A design depends only on its settings, this program and its libraries. It is stored on disk, since importing
the libraries that compute it takes longer than most runs.
"""

import functools
import json

from cranectl.design.family import CONTROLLERS
from cranectl.design.records import NO_ROBUSTIFIER, Design, Margins, Robustifier
from cranectl.scenario import DesignSettings
from cranectl.support import Arguments, InputError, kept


@Arguments.checked
@functools.lru_cache(maxsize=64)
def design_controller(name: str, settings: DesignSettings | None = None) -> Design:
    """Design a controller of the flat family, or take the design that an earlier process stored.

    Parameters
    ----------
    name : str
        One of `CONTROLLERS`.
    settings : DesignSettings, optional
        Poles, weights and bounds; by default those of the thesis.

    Returns
    -------
    Design
        The design of one axis.

    Raises
    ------
    InputError
        For an unknown name, and for settings that no controller can meet.

    Examples
    --------
    >>> design_controller("lqr").gain.shape
    (4,)
    """
    InputError.check_known("controller", [name], CONTROLLERS)
    settings = settings or DesignSettings()
    text = kept(
        "designs",
        [name, settings.model_dump(mode="json")],
        lambda: json.dumps(_computed(name, settings).to_json()),
    )
    # Read back even if just computed: arrays of another memory order may change the last bit of a product.
    return Design.from_json(json.loads(text))


def _computed(name: str, settings: DesignSettings) -> Design:
    # python-control takes more than a second to import, and each synthesis more.
    from cranectl.design.linear_systems import NOTHING, closed_loop_poles, open_loop
    from cranectl.design.state_feedback import lqr_gain, pole_placement_gain

    feedback, _, kind = name.partition("+")
    gain = {"pole-placement": pole_placement_gain, "lqr": lqr_gain}[feedback](settings)
    robustifier = NOTHING
    if kind == "hinf":
        from cranectl.design.mixed_sensitivity import hinf_robustifier

        robustifier = hinf_robustifier(gain, settings)
    elif kind == "loop-shaping":
        from cranectl.design.loop_shaping import loop_shaping_robustifier

        robustifier = loop_shaping_robustifier(gain, settings)
    loop, modal = open_loop(gain, robustifier.system), robustifier.modal
    gamma = robustifier.gamma
    record = Robustifier(modal.A, modal.B.ravel(), modal.C.ravel(), float(modal.D[0, 0]))
    return Design(
        name=name,
        gain=gain,
        closed_loop_poles=closed_loop_poles(loop),
        margins=Margins.of(loop),
        robustifier=record if record.order else NO_ROBUSTIFIER,
        gamma=robustifier.gamma_min,
        gamma_achieved=gamma,
        stability_margin=1.0 / gamma if gamma is not None and kind == "loop-shaping" else None,
    )
