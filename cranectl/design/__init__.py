"""Controller designs: state feedback per axis on z'''' = v, with margins, as one record."""

from cranectl.design.controllers import CONTROLLERS, TITLES, design_controller, with_gain
from cranectl.design.records import ControllerDesign, Design, Robustifier

__all__ = [
    "CONTROLLERS",
    "TITLES",
    "ControllerDesign",
    "Design",
    "Robustifier",
    "design_controller",
    "with_gain",
]
