"""The geometry of a user's model, for pictures of its runs, in place of the shapes of the shipped model."""

from typing import Any
from xml.etree import ElementTree

import mujoco

from cranectl.plants.mujoco.own_file import SENSOR_NAME
from cranectl.plants.mujoco.sites import SiteModel
from cranectl.scenario import ModelNames

PREFIX = "own/"  # of the names of what the user's model has
PARTS = ("compiler", "default", "asset", "worldbody", "tendon")  # of a model that are drawn
KEPT = "floor"  # of the shipped shapes


class OwnGeometry:
    """The geometry of a model in a log, which stands on the shipped model; the joints of that stay."""

    def __init__(self, model: str, names: ModelNames) -> None:
        """Open a model in MJCF; raise KeyError or ValueError if it is not a user's, or has no shapes."""
        root = ElementTree.fromstring(model)
        attributes = [item for element in root.iter() for item in element.items()]
        if (
            any(name.startswith("file") for name, _ in attributes)
            or ("name", f"{SENSOR_NAME}0") not in attributes
        ):
            raise ValueError("it reads files, or is not a user's")
        for part in [part for part in root if part.tag not in PARTS]:
            root.remove(part)
        self._names, self._spec = names, mujoco.MjSpec.from_string(ElementTree.tostring(root, "unicode"))
        for plane in [geom for geom in self._spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]:
            self._spec.delete(plane)
        if not self._spec.geoms:
            raise ValueError("it has nothing to draw")
        compiled = self._spec.compile()
        data = mujoco.MjData(compiled)
        mujoco.mj_kinematics(compiled, data)
        self._height, _ = (float(data.site(name).xpos[2]) for name in (names.pivot, names.load))

    def replace_shapes(self, spec: Any) -> None:
        """Put the geometry into `spec`, the shipped model, with its pivot at the height of the trolley."""
        for geom in [geom for geom in spec.geoms if geom.name != KEPT]:
            spec.delete(geom)
        spec.attach(self._spec, prefix=PREFIX, frame=spec.worldbody.add_frame(pos=[0.0, 0.0, -self._height]))
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)

    def mover(self, model: Any) -> SiteModel:
        """Return what moves the geometry in `model`, the compiled spec."""
        return SiteModel(model, (PREFIX + self._names.pivot, PREFIX + self._names.load), "the drawn model")


def own_geometry(model: str, names: ModelNames) -> OwnGeometry | None:
    """Return the geometry of the model in a log, or None if the shipped shapes stand for it."""
    try:
        return OwnGeometry(model, names)
    except (KeyError, ValueError, ElementTree.ParseError):
        return None
