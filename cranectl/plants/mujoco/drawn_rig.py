"""The model of a rig for pictures: the shipped shapes to scale, or the geometry of a user's model."""

from typing import Any

import mujoco
import numpy as np

from cranectl.plants.mujoco.geometry import ASPECT, FLOOR, NEAR_POST, drawn_spec
from cranectl.plants.mujoco.model import state_addresses
from cranectl.plants.mujoco.own_geometry import PREFIX, own_geometry
from cranectl.scenario import RigParameters
from cranectl.support import Array, InputError


class DrawnRig:
    """A rig as pictures show it; its `spec` may be changed until it is compiled to its `model`."""

    CAMERAS = ("overview", "side", "top")  # of the shipped model
    FLOOR = FLOOR  # [m] from the middle of the laboratory to the edge of its pictures
    NEAR_POST = NEAR_POST  # names of posts between the overview's camera and the load begin with this

    def __init__(self, rig: RigParameters, description: str = "") -> None:
        """Take the shapes of `rig`, or those of `description`, an MJCF text, if it is a user's model."""
        self.spec: Any = drawn_spec(rig)
        self._own = own_geometry(description, rig.plant.names) if description else None
        if self._own:
            self._own.replace_shapes(self.spec)

    def compile(self, width: int, height: int) -> None:
        """Make the model for pictures of this size [px]; narrow ones from CAMERAS show the whole rig too."""
        self.spec.visual.global_.offwidth, self.spec.visual.global_.offheight = width, height
        self.model: Any = self.spec.compile()
        # Cameras have a fixed vertical angle.
        widening = max(1.0, ASPECT * height / width)
        for camera in map(self.model.camera, self.CAMERAS):
            tangent = np.tan(np.radians(camera.fovy) / 2.0)
            camera.fovy = np.degrees(2.0 * np.arctan(tangent * widening))
        self._addresses = state_addresses(self.model)
        self._mover = self._own.mover(self.model) if self._own else None

    def find_camera(self, name: str | None) -> str:
        """Return the model's name of a user's camera, or one of CAMERAS; None means the first of these.

        Raises InputError if neither the user's nor the shipped model has a camera of this name.
        """
        if name is None:
            return self.CAMERAS[0]
        named = [self.model.camera(k).name for k in range(self.model.ncam)]
        own = [camera.removeprefix(PREFIX) for camera in named if camera.startswith(PREFIX)]
        if name in own:
            return PREFIX + name
        known = dict.fromkeys((*filter(None, own), *self.CAMERAS))
        if name not in self.CAMERAS:
            raise InputError(
                f"unknown camera '{name}'",
                allowed=", ".join(known) + ("" if own else " (the drawn model has no other cameras)"),
                remedy=InputError.did_you_mean(name, known) or "leave out --camera for the overview",
            )
        return name

    def place(self, data: mujoco.MjData, state: Array) -> None:
        """Set `data` of the model to `state` (10,)."""
        data.qpos[self._addresses] = state[0::2]
        if self._mover:
            self._mover.place(data, state)
