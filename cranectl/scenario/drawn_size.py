"""How a rig is drawn, and how large: as laboratory frame, bridge crane or ship-to-shore crane.

The laboratory frame is that of `models/crane.xml`, stretched to other ranges. Parts at the ends of the ranges
move with these. Thicknesses, distances from an end and lengths of arrows have one common scale, 1 for the
laboratory. All this is for drawings only and changes no plant.
"""

from typing import Literal, NamedTuple

import numpy as np

from cranectl.scenario.rig import RigParameters
from cranectl.support import Array

LABORATORY = RigParameters()
FILED_RADIUS = 0.05  # [m] of the model file's ball of 1 kg: 1910 kg/m³, like a loaded container
RADIUS_LIMITS = (0.6, 2.0)  # over the scaled FILED_RADIUS: a light load is visible, a heavy one hides nothing
FILED_TRAIL = 4.0  # [s], two swings of the laboratory's rope
FILED_BOX = ((-0.125, -0.145, -1.4), (2.125, 1.685, 0.225))  # [m], corners of the rig in the model file
MAX_FRAME_SCALE = 3.0  # scale up to which a rig is drawn as the laboratory frame
MIN_PORTAL_LIFT = 15.0  # [m] of a ship-to-shore crane
MIN_PORTAL_SHARE = 0.5  # lift over the travel of the trolley; halls are wider than high

CraneKind = Literal["laboratory frame", "bridge crane", "ship-to-shore crane"]


def drawn_ends(rig: RigParameters) -> Array:
    """Return the ends of bridge, trolley and rope along x, y, z [m], shape (3, 2)."""
    return np.array([rig.bridge_range, rig.trolley_range, (-rig.rope_range[1], 0.0)])


def drawn_as_filed(rig: RigParameters) -> bool:
    """Return True if the rig has the laboratory's ranges, so that nothing is stretched."""
    return bool((drawn_ends(rig) == drawn_ends(LABORATORY)).all())


def _extents(rig: RigParameters) -> Array:
    """Return the extent of each range relative to the laboratory's, shape (3,)."""
    ratios: Array = np.ptp(drawn_ends(rig), axis=1) / np.ptp(drawn_ends(LABORATORY), axis=1)
    return ratios


def drawn_scale(rig: RigParameters) -> float:
    """Return how many times thicker than the laboratory's the rig's parts are drawn.

    It is the median of the three extents, so that a long track or a deep shaft alone makes no part thick.
    """
    return float(np.median(_extents(rig)))


def drawn_reach(rig: RigParameters) -> float:
    """Return how many times larger than the laboratory's the floor and the surroundings are drawn."""
    return float(_extents(rig).max())


def crane_kind(rig: RigParameters) -> CraneKind:
    """Return the kind of crane that a rig is drawn as, by its size and proportions.

    A rig of at most three times the laboratory's size is a frame. A larger one is a ship-to-shore crane if
    it lifts loads by 15 m or more, and by half the travel of its trolley or more. Else it is a bridge crane.
    """
    if drawn_scale(rig) <= MAX_FRAME_SCALE:
        return "laboratory frame"
    _, travel, lift = np.ptp(drawn_ends(rig), axis=1) - (0.0, 0.0, rig.rope_range[0])
    is_portal = lift >= max(MIN_PORTAL_LIFT, MIN_PORTAL_SHARE * travel)
    return "ship-to-shore crane" if is_portal else "bridge crane"


class Portal(NamedTuple):
    """Positions of the parts of a ship-to-shore crane [m]; z from the trolley's height, x from its middle."""

    half_width: float  # of the legs along x
    landside: float  # y of the legs
    waterside: float
    girder: tuple[float, float]  # its ends along y
    top: float  # z of the beams over the girder
    apex: float  # z from where the girder hangs


def drawn_portal(rig: RigParameters) -> Portal:
    """Return the portal of a ship-to-shore crane: the trolley passes between its legs and over the water."""
    scale, (start, end) = drawn_scale(rig), rig.trolley_range
    travel = end - start
    return Portal(
        half_width=0.32 * scale,
        landside=start - 0.15 * scale,
        waterside=start + 0.4 * travel,
        girder=(start - 0.35 * scale, end + 0.2 * scale),
        top=0.3 * scale,
        apex=0.3 * scale + 0.28 * travel,
    )


def drawn_load_radius(rig: RigParameters) -> float:
    """Return the radius of the drawn load [m]: that in `look`, or else one that fits its mass."""
    if rig.look.load_radius is not None:
        return rig.look.load_radius
    low, high = (drawn_scale(rig) * FILED_RADIUS * limit for limit in RADIUS_LIMITS)
    return float(np.clip(FILED_RADIUS * np.cbrt(rig.load_mass), low, high))


def drawn_trail(rig: RigParameters) -> float:
    """Return how long a trail shows the path of the load [s]: the same number of swings on any rope."""
    return float(FILED_TRAIL * np.sqrt(drawn_scale(rig)))


def drawn_place(filed: Array, rig: RigParameters) -> Array:
    """Return where a point (x, y, z) of the model file's frame is drawn for another rig [m].

    Along each axis it keeps its distance, times the scale, from the nearer end of the range.
    """
    old, new = drawn_ends(LABORATORY), drawn_ends(rig)
    nearer = np.arange(3), np.abs(old - filed[:, None]).argmin(axis=1)
    position: Array = new[nearer] + drawn_scale(rig) * (filed - old[nearer])
    return position


def drawn_box(rig: RigParameters) -> Array:
    """Return the lowest and the highest corner of the drawn rig [m], shape (2, 3)."""
    if crane_kind(rig) == "ship-to-shore crane":
        portal, (start, end) = drawn_portal(rig), rig.bridge_range
        beside = portal.half_width + 0.05 * drawn_scale(rig)
        low = (start - beside, portal.girder[0], -rig.rope_range[1])
        return np.array([low, (end + beside, portal.girder[1], portal.apex)])
    return np.array([drawn_place(np.array(corner), rig) for corner in FILED_BOX])


def drawn_eye(filed: Array, axes: Array, tangents: Array, rig: RigParameters) -> tuple[Array, float]:
    """Return the position of a camera for another rig [m], and its distance over that of the laboratory.

    The rig fills its picture as the laboratory does. The rows of `axes` (3, 3) are the directions to the
    camera's right, up and backwards. `tangents` (2,) are those of half its angles of view.
    """
    old, new = (_fitted_eye(drawn_box(drawn), axes, tangents) for drawn in (LABORATORY, rig))
    distances = [
        axes[2] @ (eye - drawn_box(drawn).mean(axis=0)) for drawn, eye in ((LABORATORY, old), (rig, new))
    ]
    farther = distances[1] / distances[0]
    return new + farther * (filed - old), float(farther)


def _fitted_eye(box: Array, axes: Array, tangents: Array) -> Array:
    """Return where the box just fills a picture [m], (3,): ±u·(p - eye) ≤ t w·(eye - p) for each corner p."""
    across_up, back = np.split(axes @ np.array(np.meshgrid(*box.T)).reshape(3, -1), [2])
    depth = np.outer(tangents, back)
    high, low = (across_up + depth).max(axis=1), (depth - across_up).max(axis=1)
    eye: Array = axes.T @ np.append((high - low) / 2.0, ((high + low) / (2.0 * tangents)).max())
    return eye
