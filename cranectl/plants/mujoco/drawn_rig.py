"""The model of a rig for pictures: the shipped shapes to scale, or the geometry of a user's model."""

from typing import Any

import mujoco
import numpy as np

from cranectl.plants.mujoco.geometry import ASPECT, FLOOR, NEAR_POST, drawn_spec
from cranectl.plants.mujoco.model import state_addresses
from cranectl.plants.mujoco.own_geometry import own_geometry
from cranectl.scenario import RigParameters
from cranectl.support import Array


class DrawnRig:
    """A rig as pictures show it; its `spec` may be changed until it is compiled to its `model`."""

    FLOOR = FLOOR  # [m] from the middle of the laboratory to the edge of its pictures
    NEAR_POST = NEAR_POST  # names of posts between the overview's camera and the load begin with this

    def __init__(self, rig: RigParameters, description: str = "") -> None:
        """Take the shapes of `rig`, or those of `description`, an MJCF text, if it is a user's model."""
        self.spec: Any = drawn_spec(rig)
        self._own = own_geometry(description, rig.plant.names) if description else None
        if self._own:
            self._own.replace_shapes(self.spec)

    @property
    def is_own(self) -> bool:
        """Whether the shapes are those of a user's model."""
        return self._own is not None

    def compile(self, width: int, height: int) -> None:
        """Make the model for pictures of this size [px]; cameras of narrow ones show the whole rig too."""
        self.spec.visual.global_.offwidth, self.spec.visual.global_.offheight = width, height
        self.model: Any = self.spec.compile()
        # Cameras have a fixed vertical angle.
        widening = max(1.0, ASPECT * height / width)
        tangent = np.tan(np.radians(self.model.cam_fovy) / 2.0)
        self.model.cam_fovy[:] = np.degrees(2.0 * np.arctan(tangent * widening))
        self._addresses = state_addresses(self.model)
        self._mover = self._own.mover(self.model) if self._own else None

    def place(self, data: mujoco.MjData, state: Array) -> None:
        """Set `data` of the model to `state` (10,)."""
        data.qpos[self._addresses] = state[0::2]
        if self._mover:
            self._mover.place(data, state)
