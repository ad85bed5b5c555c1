"""How a rig is drawn, and how large: as laboratory frame, bridge crane or ship-to-shore crane.

The laboratory frame is that of `models/crane.xml`, stretched to other ranges. Parts at the ends of the ranges
move with these. Thicknesses, distances from an end and lengths of arrows have one common scale, 1 for the
laboratory. All this is for drawings only and changes no plant.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from cranectl.scenario.rig import RigParameters
from cranectl.support import Array

RADIUS_LIMITS = (0.6, 2.0)  # over the scaled FILED_RADIUS: a light load is visible, a heavy one hides nothing
FILED_RADIUS = 0.05  # [m] of the model file's ball of 1 kg: 1910 kg/m³, like a loaded container
FILED_TRAIL = 4.0  # [s], two swings of the laboratory's rope
FILED_BOX = ((-0.125, -0.145, -1.4), (2.125, 1.685, 0.225))  # [m], corners of the rig in the model file
MAX_FRAME_SCALE = 3.0  # scale up to which a rig is drawn as the laboratory frame
MIN_PORTAL_LIFT = 15.0  # [m] of a ship-to-shore crane
MIN_PORTAL_SHARE = 0.5  # lift over the travel of the trolley; halls are wider than high

CraneKind = Literal["laboratory frame", "bridge crane", "ship-to-shore crane"]


class Portal(NamedTuple):
    """Positions of the parts of a ship-to-shore crane [m]; z from the trolley's height, x from its middle."""

    half_width: float  # of the legs along x
    landside: float  # y of the legs
    waterside: float
    girder: tuple[float, float]  # its ends along y
    top: float  # z of the beams over the girder
    apex: float  # z from where the girder hangs


@dataclass(frozen=True)
class Drawing:
    """The drawing of a rig: its kind, its sizes, and where its parts and its cameras are."""

    rig: RigParameters  # what is drawn

    @property
    def ends(self) -> Array:
        """Ends of bridge, trolley and rope along x, y, z [m], shape (3, 2)."""
        rig = self.rig
        return np.array([rig.bridge_range, rig.trolley_range, (-rig.rope_range[1], 0.0)])

    @property
    def is_as_filed(self) -> bool:
        """Whether the rig has the laboratory's ranges, so that nothing is stretched."""
        return bool((self.ends == LABORATORY.ends).all())

    @property
    def _extents(self) -> Array:
        """Extent of each range relative to the laboratory's, shape (3,)."""
        ratios: Array = np.ptp(self.ends, axis=1) / np.ptp(LABORATORY.ends, axis=1)
        return ratios

    @property
    def scale(self) -> float:
        """How many times thicker than the laboratory's the rig's parts are drawn.

        It is the median of the three extents, so that a long track or a deep shaft alone makes no part thick.
        """
        return float(np.median(self._extents))

    @property
    def reach(self) -> float:
        """How many times larger than the laboratory's the floor and the surroundings are drawn."""
        return float(self._extents.max())

    @property
    def kind(self) -> CraneKind:
        """The kind of crane that the rig is drawn as, by its size and proportions.

        A rig of at most three times the laboratory's size is a frame. A larger one is a ship-to-shore crane
        if it lifts loads by 15 m or more, and by half the travel of its trolley or more. Else it is a bridge
        crane.
        """
        if self.scale <= MAX_FRAME_SCALE:
            return "laboratory frame"
        _, travel, lift = np.ptp(self.ends, axis=1) - (0.0, 0.0, self.rig.rope_range[0])
        is_portal = lift >= max(MIN_PORTAL_LIFT, MIN_PORTAL_SHARE * travel)
        return "ship-to-shore crane" if is_portal else "bridge crane"

    @property
    def portal(self) -> Portal:
        """The portal of a ship-to-shore crane: the trolley passes between its legs and over the water."""
        scale, (start, end) = self.scale, self.rig.trolley_range
        travel = end - start
        return Portal(
            half_width=0.32 * scale,
            landside=start - 0.15 * scale,
            waterside=start + 0.4 * travel,
            girder=(start - 0.35 * scale, end + 0.2 * scale),
            top=0.3 * scale,
            apex=0.3 * scale + 0.28 * travel,
        )

    @property
    def load_radius(self) -> float:
        """Radius of the drawn load [m]: that in `look`, or else one that fits its mass."""
        rig = self.rig
        if rig.look.load_radius is not None:
            return rig.look.load_radius
        low, high = (self.scale * FILED_RADIUS * limit for limit in RADIUS_LIMITS)
        return float(np.clip(FILED_RADIUS * np.cbrt(rig.load_mass), low, high))

    @property
    def load_scale(self) -> float:
        """How many times larger than in the model file the load is drawn."""
        return self.load_radius / FILED_RADIUS

    @property
    def trail(self) -> float:
        """How long a trail shows the path of the load [s]: the same number of swings on any rope."""
        return float(FILED_TRAIL * np.sqrt(self.scale))

    @property
    def box(self) -> Array:
        """The lowest and the highest corner of the drawn rig [m], shape (2, 3)."""
        rig = self.rig
        if self.kind == "ship-to-shore crane":
            portal, (start, end) = self.portal, rig.bridge_range
            beside = portal.half_width + 0.05 * self.scale
            low = (start - beside, portal.girder[0], -rig.rope_range[1])
            return np.array([low, (end + beside, portal.girder[1], portal.apex)])
        return np.array([self.place(np.array(corner)) for corner in FILED_BOX])

    def place(self, filed: Array) -> Array:
        """Return where a point (x, y, z) of the model file's frame is drawn [m].

        Along each axis it keeps its distance, times the scale, from the nearer end of the range.
        """
        old, new = LABORATORY.ends, self.ends
        nearer = np.arange(3), np.abs(old - filed[:, None]).argmin(axis=1)
        position: Array = new[nearer] + self.scale * (filed - old[nearer])
        return position

    def eye(self, filed: Array, axes: Array, tangents: Array) -> tuple[Array, float]:
        """Return the position of a camera [m], and its distance over that of the laboratory.

        The rig fills its picture as the laboratory does. The rows of `axes` (3, 3) are the directions to the
        camera's right, up and backwards. `tangents` (2,) are those of half its angles of view.
        """
        boxes = LABORATORY.box, self.box
        old, new = (_fitted_eye(box, axes, tangents) for box in boxes)
        distances = [axes[2] @ (eye - box.mean(axis=0)) for box, eye in zip(boxes, (old, new), strict=True)]
        farther = distances[1] / distances[0]
        return new + farther * (filed - old), float(farther)


LABORATORY = Drawing(RigParameters())


def _fitted_eye(box: Array, axes: Array, tangents: Array) -> Array:
    """Return where the box just fills a picture [m], (3,): ±u·(p - eye) ≤ t w·(eye - p) for each corner p."""
    across_up, back = np.split(axes @ np.array(np.meshgrid(*box.T)).reshape(3, -1), [2])
    depth = np.outer(tangents, back)
    high, low = (across_up + depth).max(axis=1), (depth - across_up).max(axis=1)
    eye: Array = axes.T @ np.append((high - low) / 2.0, ((high + low) / (2.0 * tangents)).max())
    return eye
