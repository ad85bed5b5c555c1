"""Measure what screenshots show."""

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
    """Return True if a colour (#rrggbb) is close to grey."""
    red_green_blue = matplotlib.colors.to_rgb(colour)
    return max(red_green_blue) - min(red_green_blue) < 0.2


def count_coloured(picture: Picture, colour: str, tolerance: int = 40) -> int:
    """Count the pixels of nearly this colour (#rrggbb)."""
    expected = np.round(255.0 * np.array(matplotlib.colors.to_rgb(colour)))
    return int((np.abs(picture - expected).max(axis=2) < tolerance).sum())


def count_foreground(picture: Picture) -> int:
    """Count the pixels that differ from the most frequent colour, without the panel's border."""
    _, counts = np.unique(picture[4:-4, 4:-4].reshape(-1, 3), axis=0, return_counts=True)
    return int(counts.sum() - counts.max())


def hue_mask(picture: Picture, low: float, high: float) -> Mask:
    """Select saturated pixels with a hue [degrees] from `low` to `high`, whatever their lighting."""
    hue, saturation, value = np.moveaxis(matplotlib.colors.rgb_to_hsv(picture / 255.0), 2, 0)
    return ((360.0 * hue - low) % 360.0 <= high - low) & (saturation > 0.5) & (value > 0.2)


def bridge_mask(picture: Picture) -> Mask:
    """Select the crane's bridge, which is orange."""
    return hue_mask(picture, 25.0, 50.0)


def load_mask(picture: Picture) -> Mask:
    """Select the crane's load, which is red."""
    return hue_mask(picture, -12.0, 12.0)


def centroid(mask: Mask) -> NDArray[np.float64]:
    """Return the mean position (x right, y down) of the selected pixels."""
    y, x = np.nonzero(mask)
    return np.array([x.mean(), y.mean()])


def project(camera: Mapping[str, Any], picture: Picture, point: ArrayLike) -> NDArray[np.float64]:
    """Project a point of the world [m] to pixels (x right, y down) with a panel's cameraState."""
    orientation = Rotation.from_euler("ZX", [-camera["thetaOffset"], camera["phi"]], degrees=True)
    x, y, z = orientation.inv().apply(np.asarray(point) - camera["targetOffset"])
    height, width = picture.shape[:2]
    focal = 0.5 * height / math.tan(0.5 * math.radians(camera["fovy"]))
    depth = camera["distance"] - z
    return np.array([0.5 * width + focal * x / depth, 0.5 * height - focal * y / depth])
