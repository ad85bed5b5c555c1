"""Design controllers of the flat family: state feedback of each axis on z'''' = v, with its margins."""

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
