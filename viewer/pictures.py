"""What can be told from pixels."""

import math
from collections.abc import Mapping
from typing import Any

import matplotlib.colors
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Picture = NDArray[np.uint8]  # (height, width, 3)
Mask = NDArray[np.bool_]


def is_grey(colour: str) -> bool:
    """Whether a colour (#rrggbb) is close to grey."""
    red_green_blue = matplotlib.colors.to_rgb(colour)
    return max(red_green_blue) - min(red_green_blue) < 0.2


def coloured(picture: Picture, colour: str, tolerance: int = 40) -> int:
    """Number of pixels of nearly this colour (#rrggbb)."""
    wanted = np.round(255.0 * np.array(matplotlib.colors.to_rgb(colour)))
    return int((np.abs(picture - wanted).max(axis=2) < tolerance).sum())


def foreground(picture: Picture) -> int:
    """Number of pixels that do not have the most frequent colour, without the panel's border."""
    _, counts = np.unique(picture[4:-4, 4:-4].reshape(-1, 3), axis=0, return_counts=True)
    return int(counts.sum() - counts.max())


def hue(picture: Picture, low: float, high: float) -> Mask:
    """Strongly coloured pixels with a hue [degrees] between these, whatever light falls on them."""
    hue, saturation, value = np.moveaxis(matplotlib.colors.rgb_to_hsv(picture / 255.0), 2, 0)
    return ((360.0 * hue - low) % 360.0 <= high - low) & (saturation > 0.5) & (value > 0.2)


def bridge(picture: Picture) -> Mask:
    """The crane's bridge, which is orange."""
    return hue(picture, 25.0, 50.0)


def load(picture: Picture) -> Mask:
    """The crane's load, which is red."""
    return hue(picture, -12.0, 12.0)


def blue(picture: Picture) -> Mask:
    """Ghosts of the analytic plant, and the trolley of a solid crane."""
    return hue(picture, 195.0, 235.0)


def centre(mask: Mask) -> NDArray[np.float64]:
    """Mean place (x right, y down) of what the mask shows [pixels]."""
    y, x = np.nonzero(mask)
    return np.array([x.mean(), y.mean()])


def project(camera: Mapping[str, Any], picture: Picture, point: ArrayLike) -> NDArray[np.float64]:
    """Where a point of the world [m] is for a panel's cameraState (x right, y down) [pixels]."""
    turned = Rotation.from_euler("ZX", [-camera["thetaOffset"], camera["phi"]], degrees=True)
    x, y, z = turned.inv().apply(np.asarray(point) - camera["targetOffset"])
    height, width = picture.shape[:2]
    focal = 0.5 * height / math.tan(0.5 * math.radians(camera["fovy"]))
    depth = camera["distance"] - z
    return np.array([0.5 * width + focal * x / depth, 0.5 * height - focal * y / depth])
