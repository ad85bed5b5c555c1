"""The registry of controllers and the one way to design them."""

import numpy as np

from cranectl.design.record import NO_ROBUSTIFIER, Design
from cranectl.errors import unknown_name
from cranectl.scenario import DesignSettings

CONTROLLERS = ("pole-placement", "lqr")


def design_controller(name: str, settings: DesignSettings | None = None) -> Design:
    """Design the controller `name`; raises InputError for a name not in `CONTROLLERS`."""
    if name not in CONTROLLERS:
        raise unknown_name("controller", name, CONTROLLERS)
    from cranectl.design import state_feedback as feedback  # python-control takes a second to import

    settings = settings or DesignSettings()
    gains = {"pole-placement": feedback.pole_placement_gain, "lqr": feedback.lqr_gain}
    gain = gains[name](settings)
    closed_loop = feedback.CHAIN_A - feedback.CHAIN_B @ gain.reshape(1, 4)
    gain_margin, phase_margin, modulus_margin, crossover = feedback.loop_margins(gain)
    return Design(
        name=name,
        gain=gain,
        closed_loop_poles=np.sort_complex(np.linalg.eigvals(closed_loop).astype(complex)),
        gain_margin=gain_margin,
        phase_margin=phase_margin,
        modulus_margin=modulus_margin,
        crossover=crossover,
        robustifier=NO_ROBUSTIFIER,
    )
