"""Draw Figure 2.1: the crane, its frame and its angles, in oblique projection."""

import math

from blocks import (
    BUS,
    INK,
    SMALL,
    THIN,
    Point,
    area,
    branch,
    dashed,
    label,
    signal,
)
from schemdraw import Drawing
from schemdraw.flow import Circle

Vector = tuple[float, float, float]

# State of the drawn crane, with large angles; lengths in drawing units.
LENGTH, DEPTH = 9.4, 5.0
BRIDGE, TROLLEY, ROPE = 3.8, 2.4, 5.0
ALPHA, BETA = math.radians(24.0), math.radians(28.0)


def project(p: Vector) -> Point:
    """Return an oblique projection: x to the right, z up, y into the picture."""
    x, y, z = p
    return (x + 0.5 * y, z + 0.4 * y)


def rope_end(alpha: float, beta: float, length: float) -> Point:
    """Return the projected end of a rope with these angles and length."""
    return project(
        (
            BRIDGE + length * math.sin(beta),
            TROLLEY + length * math.cos(beta) * math.sin(alpha),
            -length * math.cos(alpha) * math.cos(beta),
        )
    )


def draw_crane(d: Drawing) -> None:
    """Draw Figure 2.1."""
    _draw_frame(d)
    _draw_rig(d)
    _draw_angles(d)


def _draw_frame(d: Drawing) -> None:
    origin = project((0.0, 0.0, 0.0))
    for end, name, at in (
        ((LENGTH + 1.4, 0.0, 0.0), "x", (LENGTH + 1.2, 0.0, -0.4)),
        ((0.0, DEPTH + 1.6, 0.0), "y", (-0.4, DEPTH + 1.4, 0.0)),
        ((0.0, 0.0, 2.6), "z", (-0.35, 0.0, 2.4)),
    ):
        signal(d, origin, project(end), lw=THIN)
        label(d, project(at), name)


def _draw_rig(d: Drawing) -> None:
    for y in (0.0, DEPTH):
        signal(d, project((0.0, y, 0.0)), project((LENGTH, y, 0.0)), arrow=None, lw=BUS)
    for half, y_0, y_1 in (
        (0.22, 0.0, TROLLEY - 0.6),
        (0.5, TROLLEY - 0.6, TROLLEY + 0.6),
        (0.22, TROLLEY + 0.6, DEPTH),
    ):
        corners = ((-half, y_0), (half, y_0), (half, y_1), (-half, y_1))
        area(d, *(project((BRIDGE + x, y, 0.0)) for x, y in corners))
    branch(d, rope_end(0.0, 0.0, 0.0))
    label(d, project((BRIDGE + 0.5, DEPTH - 0.8, 0.0)), "bridge", align="left", size=SMALL)
    label(d, project((BRIDGE + 1.0, TROLLEY, 0.0)), "trolley", align="left", size=SMALL)

    below, beside = -0.6, BRIDGE - 1.3
    signal(d, project((0.0, 0.0, below)), project((BRIDGE, 0.0, below)), arrow="<->", lw=THIN)
    dashed(d, project((BRIDGE, 0.0, 0.0)), project((BRIDGE, 0.0, below - 0.15)))
    label(d, project((0.5 * BRIDGE, 0.0, below - 0.35)), "x_c")
    signal(d, project((beside, 0.0, 0.0)), project((beside, TROLLEY, 0.0)), arrow="<->", lw=THIN)
    dashed(d, project((beside - 0.15, TROLLEY, 0.0)), project((BRIDGE - 0.5, TROLLEY, 0.0)))
    label(d, project((beside - 0.85, 0.55 * TROLLEY, 0.0)), "y_c")


def _draw_angles(d: Drawing) -> None:
    """Draw the rope, the vertical, its projection on the bridge's plane, and both angles."""
    start, load = rope_end(0.0, 0.0, 0.0), rope_end(ALPHA, BETA, ROPE)
    in_plane = rope_end(ALPHA, 0.0, ROPE * math.cos(BETA))
    vertical = rope_end(0.0, 0.0, ROPE * math.cos(BETA) * math.cos(ALPHA))
    dashed(d, start, vertical, in_plane, load)
    dashed(d, start, in_plane)
    signal(d, start, load, arrow=None)
    d.add(Circle(r=0.2, fill=INK).at(load).anchor("center"))
    label(d, (load[0] + 0.4, load[1] - 0.1), "load z", align="left")
    middle = rope_end(ALPHA, BETA, 0.62 * ROPE)
    label(d, (middle[0] + 0.3, middle[1] + 0.1), "l")

    steps = [i / 12.0 for i in range(13)]
    signal(d, *(rope_end(ALPHA * i, 0.0, 0.5 * ROPE) for i in steps), lw=THIN)
    signal(d, *(rope_end(ALPHA, BETA * i, 0.66 * ROPE) for i in steps), lw=THIN)
    for at, name in (
        (rope_end(0.5 * ALPHA, 0.0, 0.6 * ROPE), "α"),
        (rope_end(ALPHA, 0.5 * BETA, 0.56 * ROPE), "β"),
    ):
        label(d, at, name)
