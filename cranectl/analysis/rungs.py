"""The rungs of the fidelity ladder, from the ideal of theory to the rig."""

from dataclasses import dataclass

from cranectl.effects.settings import EffectSettings
from cranectl.plants.interface import Drive


@dataclass(frozen=True)
class Rung:
    """One effect more than the rung before."""

    name: str
    adds: str
    plant: str = "mujoco"
    drive: Drive = "velocity"


RUNGS = (
    Rung("continuous", "theory: nothing sampled, ideal drives", "analytic", "ideal"),
    Rung("sampled", "control at the control period, inputs held", "analytic", "ideal"),
    Rung("engine", "the physics engine in place of the equations", "mujoco", "ideal"),
    Rung("servos", "velocity servos of finite bandwidth that feel the load"),
    Rung("limits", "limits of velocity, acceleration and force"),
    Rung("sensing", "encoders and an observer in place of the state"),
    Rung("delay", "computing and transport"),
    Rung("friction", "friction of axes and joint"),
    Rung("rope", "a rope that has mass, gives and goes slack"),
    Rung("body", "a load that swings under its hook"),
    Rung("wind", "drag and gusts"),
    Rung("frame", "a frame that gives way"),
)
NAMES = tuple(rung.name for rung in RUNGS)
# A rig not set up as believed is no effect that every rig has: campaigns vary it.
EFFECTS = tuple(name for name in EffectSettings.model_fields if name != "installation")
BASE = "servos"  # what an effect alone is added to
