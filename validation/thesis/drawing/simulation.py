"""Draw Figures 5.1 to 5.6: the simulation and the parts of the linearised crane."""

from blocks import (
    SMALL,
    block,
    branch,
    frame,
    input_from_above,
    integrator,
    label,
    signal,
    summation,
)
from schemdraw import Drawing


def draw_simulation(d: Drawing) -> None:
    """Draw Figure 5.1."""
    plan = block(d, (1.2, 0.0), "reference", w=2.4)
    record = block(d, (15.7, 0.0), "log", w=1.6)
    compare = block(d, (18.9, 0.0), "comparison", w=2.8)
    frame(d, (5.3, -2.8), (8.7, 2.8))
    label(d, (7.0, 0.0), "the same law\nfor both", size=SMALL)
    signal(d, plan.E, (4.7, 0.0), arrow=None)
    label(d, (3.5, 0.32), "z_d … z_d⁗")
    branch(d, (4.7, 0.0))
    label(d, (11.7, 0.0), "d_α, d_β")
    for up, name, inner, outer in ((1.0, "analytic\nplant", "S", "N"), (-1.0, "MuJoCo\nplant", "N", "S")):
        y, back = 1.8 * up, 3.4 * up
        tracker = block(d, (7.0, y), "tracker", w=2.2)
        plant = block(d, (11.7, y), name, w=2.2, h=1.4)
        signal(d, (4.7, 0.0), (4.7, y), tracker.W)
        signal(d, tracker.E, plant.W)
        label(d, (9.6, y + 0.3), "u")
        signal(d, (11.7, 0.35 * up), getattr(plant, inner))
        signal(d, getattr(plant, outer), (11.7, back), (7.0, back), getattr(tracker, outer))
        label(d, (9.6, back + 0.32), "q, q̇")
        signal(d, plant.E, (15.7, y), getattr(record, outer))
        label(d, (14.1, y + 0.32), "q, q̇, z")
    signal(d, record.E, compare.W)


def draw_plant(d: Drawing) -> None:
    """Draw Figure 5.2."""
    g = block(d, (2.6, 0.0), "g(x)", w=1.4)
    total = summation(d, (5.2, 0.0), W="+", N="+", S="+")
    box = integrator(d, (7.4, 0.0))
    f = block(d, (7.4, -1.9), "f(x)", w=1.4)
    signal(d, (0.6, 0.0), g.W)
    label(d, (1.2, 0.3), "u")
    signal(d, g.E, total.W)
    input_from_above(d, total.N, "d_α, d_β")
    signal(d, total.E, box.W)
    label(d, (6.2, 0.3), "ẋ")
    signal(d, box.E, (10.4, 0.0))
    label(d, (9.8, 0.3), "x")
    branch(d, (9.0, 0.0))
    branch(d, (9.0, -1.9))
    signal(d, (9.0, 0.0), (9.0, -1.9), f.E)
    signal(d, f.W, (5.2, -1.9), total.S)
    signal(d, (9.0, -1.9), (9.0, -3.2), (2.6, -3.2), g.S)


def draw_flat_coordinates(d: Drawing) -> None:
    """Draw Figure 5.3."""
    rows = ((2.25, "z", "e"), (0.75, "ż", "ė"), (-0.75, "z̈", "ë"), (-2.25, "z⃛", "e⃛"))
    flat = block(d, (3.6, 0.0), "flat\ncoordinates\nΦ(x, ζ, ζ̇)", w=2.8, h=5.8)
    for y, name in ((1.5, "x"), (0.0, "ζ"), (-1.5, "ζ̇")):
        signal(d, (0.8, y), (flat.W[0], y))
        label(d, (1.4, y + 0.3), name)
    for y, name, error in rows:
        total = summation(d, (7.2, y), W="−", N="+")
        signal(d, (flat.E[0], y), total.W)
        label(d, (5.9, y + 0.3), name)
        signal(d, (7.2, y + 0.95), total.N)
        label(d, (7.4, y + 0.7), f"{name}_d", align="left")
        signal(d, total.E, (9.2, y))
        label(d, (8.7, y + 0.3), error)


def draw_linearising_law(d: Drawing) -> None:
    """Draw Figure 5.4."""
    gamma = block(d, (8.2, 0.0), "γ(x, ζ)", w=2.0)
    total = summation(d, (11.4, 0.0), W="+", S="+")
    phi = block(d, (11.4, -2.4), "φ(x, ζ, ζ̇)", w=2.2, h=1.9)
    first, second = integrator(d, (3.2, -4.6)), integrator(d, (6.0, -4.6))
    signal(d, (0.0, 0.0), gamma.W)
    label(d, (0.6, 0.3), "v")
    signal(d, gamma.E, total.W)
    signal(d, phi.N, total.S)
    signal(d, total.E, (13.4, 0.0))
    label(d, (12.7, 0.3), "u")

    branch(d, (1.6, 0.0))
    signal(d, (1.6, 0.0), (1.6, -4.6), first.W)
    label(d, (2.2, -4.3), "v₃")
    signal(d, first.E, second.W)
    signal(d, second.E, (7.8, -4.6), (7.8, gamma.S[1]))
    branch(d, (4.6, -4.6))
    signal(d, (4.6, -4.6), (4.6, -3.0), (phi.W[0], -3.0))
    label(d, (4.9, -3.7), "ζ̇")
    branch(d, (7.8, -2.4))
    signal(d, (7.8, -2.4), phi.W)
    label(d, (8.05, -3.7), "ζ")
    signal(d, (0.0, -1.8), (phi.W[0], -1.8))
    label(d, (0.6, -1.5), "x")
    branch(d, (8.6, -1.8))
    signal(d, (8.6, -1.8), (8.6, gamma.S[1]))


def draw_state_feedback(d: Drawing) -> None:
    """Draw Figure 5.5."""
    _draw_state_feedback(d)
    signal(d, (7.5, -1.5), (7.5, -0.2))
    label(d, (7.5, -1.8), "v̄")


def draw_robustified(d: Drawing) -> None:
    """Draw Figure 5.6."""
    _draw_state_feedback(d)
    robustifier = block(d, (5.2, -1.6), "R(s)")
    branch(d, (3.9, 0.0))
    signal(d, (3.9, 0.0), (3.9, -1.6), robustifier.W)
    signal(d, robustifier.E, (7.5, -1.6), (7.5, -0.2))
    label(d, (6.6, -1.3), "v̄")


def _draw_state_feedback(d: Drawing) -> None:
    error = summation(d, (2.9, 0.0), W="+", S="−")
    gain = block(d, (5.2, 0.0), "K")
    total = summation(d, (7.5, 0.0), W="+", N="+", S="+")
    crane = block(d, (11.0, 0.0), "linearised crane\nz⁗ = v", w=3.8, h=1.4)
    signal(d, (0.2, 0.0), error.W)
    label(d, (1.15, 0.32), "z_d … z⃛_d")
    signal(d, error.E, gain.W)
    label(d, (3.5, 0.3), "e")
    signal(d, gain.E, total.W)
    input_from_above(d, total.N, "z_d⁗")
    signal(d, total.E, crane.W)
    label(d, (8.35, 0.3), "v")
    signal(d, crane.E, (15.4, 0.0))
    label(d, (14.5, 0.32), "z … z⃛")
    branch(d, (13.6, 0.0))
    signal(d, (13.6, 0.0), (13.6, -2.9), (2.9, -2.9), error.S)
