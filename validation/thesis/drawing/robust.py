"""Draw Figures 4.4 to 4.9: H-infinity standard problem, mixed sensitivity, loop shaping."""

from blocks import (
    LINE,
    SMALL,
    THIN,
    Point,
    add,
    area,
    block,
    branch,
    dashed,
    frame,
    label,
    signal,
    summation,
)
from schemdraw import Drawing, SegmentBezier

FORBIDDEN = "var(--forbidden, var(--block, none))"

# Control points of both curves in Figure 4.6, and the positions at which they cross 0 dB.
LARGEST = ((0.0, 3.3), (4.6, 1.9), (7.4, -1.9667), (12.2, -3.1))
SMALLEST = ((0.0, 2.6), (4.0, 1.4), (5.2, -1.1667), (11.4, -3.3))
CROSSINGS = tuple((p[0][0] + 3.0 * p[1][0] + 3.0 * p[2][0] + p[3][0]) / 8.0 for p in (SMALLEST, LARGEST))


def draw_standard_problem(d: Drawing) -> None:
    """Draw Figure 4.4."""
    plant = block(d, (4.0, 0.0), "P(s)", w=2.4, h=2.1)
    controller = block(d, (4.0, -2.6), "K(s)", w=1.6)
    left, right = plant.W[0], plant.E[0]
    signal(d, (0.6, 0.5), (left, 0.5))
    label(d, (1.2, 0.8), "w")
    signal(d, (right, 0.5), (7.4, 0.5))
    label(d, (6.8, 0.8), "z")
    signal(d, (right, -0.5), (6.6, -0.5), (6.6, -2.6), controller.E)
    label(d, (6.9, -1.6), "v")
    signal(d, controller.W, (1.4, -2.6), (1.4, -0.5), (left, -0.5))
    label(d, (1.1, -1.6), "u")


def draw_mixed_sensitivity(d: Drawing) -> None:
    """Draw Figure 4.5."""
    plant = block(d, (5.4, 0.0), "G(s)", w=1.6)
    error = summation(d, (7.6, 0.0), W="−", N="+")
    w_s = block(d, (10.0, 0.0), "W_s(s)", w=1.6)
    w_ks = block(d, (10.0, 2.6), "W_{ks}(s)", w=1.6)
    controller = block(d, (6.6, -3.0), "K(s)", w=1.6)
    frame(d, (2.6, -1.7), (11.5, 3.6), "P(s)")

    signal(d, (1.4, 0.0), plant.W)
    branch(d, (3.6, 0.0))
    signal(d, (3.6, 0.0), (3.6, 2.6), w_ks.W)
    signal(d, (0.6, 1.3), (7.6, 1.3), error.N)
    label(d, (1.2, 1.6), "w")
    signal(d, plant.E, error.W)
    signal(d, error.E, w_s.W)
    label(d, (8.1, 0.3), "e")
    signal(d, w_s.E, (13.0, 0.0))
    label(d, (12.3, 0.3), "z₁")
    signal(d, w_ks.E, (13.0, 2.6))
    label(d, (12.3, 2.9), "z₂")
    branch(d, (8.5, 0.0))
    signal(d, (8.5, 0.0), (8.5, -1.1), (12.2, -1.1), (12.2, -3.0), controller.E)
    label(d, (9.6, -2.7), "v = e")
    signal(d, controller.W, (1.4, -3.0), (1.4, 0.0), arrow=None)
    label(d, (3.6, -2.7), "u = v̄")


def draw_specifications(d: Drawing) -> None:
    """Draw Figure 4.6."""
    bottom, top, end = -3.7, 3.5, 12.4
    area(d, (0.0, bottom), (0.0, 1.0), (3.0, 1.0), (3.0, bottom), fill=FORBIDDEN, lw=THIN)
    area(d, (9.4, top), (9.4, -1.0), (end, -1.0), (end, top), fill=FORBIDDEN, lw=THIN)
    label(d, (1.5, -1.35), "performance:\nstay above", size=SMALL)
    label(d, (10.9, 1.25), "robustness:\nstay below", size=SMALL)
    signal(d, (0.0, bottom), (end + 0.8, bottom))
    signal(d, (0.0, bottom), (0.0, top + 0.7))
    label(d, (end + 0.3, bottom - 0.4), "log ω")
    label(d, (0.25, top + 0.45), "singular values of G_s in dB", align="left", size=SMALL)
    dashed(d, (0.0, 0.0), (end, 0.0))
    label(d, (-0.35, 0.0), "0")
    for points, at, text in ((LARGEST, (5.1, 2.0), "σ̄(G_s)"), (SMALLEST, (3.9, -0.55), "σ̲(G_s)")):
        add(d, SegmentBezier(points, lw=LINE))
        label(d, at, text)
    for x in CROSSINGS:
        branch(d, (x, 0.0))
        dashed(d, (x, 0.0), (x, bottom))
    label(d, (0.5 * sum(CROSSINGS), bottom - 0.4), "crossover", size=SMALL)


def draw_shaped_plant(d: Drawing) -> None:
    """Draw Figure 4.7."""
    frame(d, (1.5, -1.2), (9.9, 1.4), "G_s(s) = W_a G W_e")
    _draw_row(d, (0.0, 0.0), ("W_e", "G", "W_a"), 11.4)


def draw_shaped_loop(d: Drawing) -> None:
    """Draw Figure 4.8."""
    frame(d, (1.5, -1.2), (9.9, 1.4), "G_s(s)")
    controller = block(d, (5.7, -2.7), "K_∞", w=1.6)
    _draw_row(d, (0.6, 0.0), ("W_e", "G", "W_a"), 10.8, arrow=None)
    signal(d, (10.8, 0.0), (10.8, -2.7), controller.E)
    signal(d, controller.W, (0.6, -2.7), (0.6, 0.0), arrow=None)


def draw_final_controller(d: Drawing) -> None:
    """Draw Figure 4.9."""
    plant = block(d, (5.7, 0.0), "G", w=1.6)
    frame(d, (1.5, -3.9), (9.9, -1.3), "K(s) = W_e K_∞ W_a")
    signal(d, (0.6, 0.0), plant.W)
    label(d, (2.4, 0.3), "v̄")
    signal(d, plant.E, (10.8, 0.0), arrow=None)
    label(d, (9.0, 0.3), "z")
    _draw_row(d, (10.8, -2.7), ("W_a", "K_∞", "W_e"), 0.6, arrow=None)
    signal(d, (10.8, 0.0), (10.8, -2.7), arrow=None)
    signal(d, (0.6, 0.0), (0.6, -2.7), arrow=None)


def _draw_row(
    d: Drawing, start: Point, names: tuple[str, str, str], end: float, arrow: str | None = "->"
) -> None:
    """Draw three blocks at fixed places between `start` and x = `end`, in the direction of the signal."""
    y = start[1]
    centres = (3.0, 5.7, 8.4) if end > start[0] else (8.4, 5.7, 3.0)
    side_in, side_out = ("W", "E") if end > start[0] else ("E", "W")
    at = start
    for x, name in zip(centres, names, strict=True):
        box = block(d, (x, y), name, w=1.4)
        signal(d, at, getattr(box, side_in))
        at = getattr(box, side_out)
    signal(d, at, (end, y), arrow=arrow)
