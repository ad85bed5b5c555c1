"""Draw Figures 3.1, 4.2 and 4.3: the tracking loop and the linearised system under feedback."""

from blocks import (
    BUS,
    SMALL,
    Point,
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

DERIVATIVES = ("z⃛", "z̈", "ż", "z")  # outputs of the integrators
ERROR_X = 2.9  # position of the sum that forms e in Figures 4.2 and 4.3


def draw_tracking_loop(d: Drawing) -> None:
    """Draw Figure 3.1."""
    block(d, (0.8, 0.6), "trajectory\ngeneration", w=3.0, h=2.4)
    error = summation(d, (4.5, 0.0), W="+", S="−")
    gain = block(d, (6.1, 0.0), "K")
    total = summation(d, (7.7, 0.0), W="+", N="+")
    law = block(d, (12.0, 0.0), "linearising law\nu = φ(x, ζ, ζ̇) + γ(x, ζ) v", w=5.2, h=1.4)
    crane = block(d, (17.2, 0.0), "crane", w=2.2, h=1.4)
    flat = block(d, (12.0, -4.5), "flat coordinates\n(x, ζ, ζ̇) → z, ż, z̈, z⃛", w=5.2, h=1.4)

    signal(d, (2.3, 0.0), error.W)
    label(d, (3.25, 0.32), "z_d … z⃛_d")
    signal(d, (2.3, 1.2), (7.7, 1.2), total.N)
    label(d, (5.05, 1.5), "z_d⁗")
    signal(d, error.E, gain.W)
    label(d, (5.05, 0.3), "e")
    signal(d, gain.E, total.W)
    signal(d, total.E, law.W)
    label(d, (8.65, 0.3), "v")
    signal(d, law.E, crane.W)
    label(d, (15.35, 0.3), "u")
    signal(d, crane.E, (19.5, 0.0))
    label(d, (18.95, 0.3), "z")
    input_from_above(d, crane.N, "d_α, d_β")

    first, second = integrator(d, (10.0, -2.2)), integrator(d, (12.2, -2.2))
    branch(d, (8.4, 0.0))
    signal(d, (8.4, 0.0), (8.4, -2.2), first.W)
    label(d, (9.0, -1.9), "v₃")
    signal(d, first.E, second.W)
    signal(d, second.E, (13.3, -2.2), arrow=None)
    for x, text in ((11.1, "ζ̇"), (13.3, "ζ")):
        branch(d, (x, -2.2))
        signal(d, (x, -2.2), (x, -0.7))
        signal(d, (x, -2.2), (x, -3.8))
        label(d, (x + 0.25, -1.5), text)
    label(d, (8.1, -2.2), "dynamic\nextension", align="right", size=SMALL)

    signal(d, crane.S, (17.2, -4.5), flat.E)
    branch(d, (17.2, -1.4))
    signal(d, (17.2, -1.4), (14.2, -1.4), (14.2, -0.7))
    label(d, (17.5, -2.9), "x")
    signal(d, flat.W, (4.5, -4.5), error.S)
    label(d, (6.8, -4.2), "z … z⃛")


def draw_closed_loop(d: Drawing) -> None:
    """Draw Figure 4.2."""
    total = _draw_error_feedback(d)
    _draw_integrators(d, total)


def draw_extended_loop(d: Drawing) -> None:
    """Draw Figure 4.3."""
    total = _draw_error_feedback(d)
    extra = summation(d, (8.2, 0.0), W="+", N="+")
    signal(d, total, extra.W)
    input_from_above(d, extra.N, "v̄")
    _draw_integrators(d, extra.E)
    frame(d, (2.1, -2.9), (17.4, 1.15))
    label(d, (17.2, -2.55), "G(s): from v̄ to z", align="right", size=SMALL)


def _draw_error_feedback(d: Drawing) -> Point:
    """Draw the part from the reference to v = z_d⁗ + K e; return the position of v."""
    error = summation(d, (ERROR_X, 0.0), W="+", S="−")
    gain = block(d, (4.8, 0.0), "K")
    total = summation(d, (6.7, 0.0), W="+", N="+")
    signal(d, (0.2, 0.0), error.W)
    label(d, (1.15, 0.32), "z_d … z⃛_d")
    signal(d, error.E, gain.W)
    label(d, (3.65, 0.3), "e")
    signal(d, gain.E, total.W)
    input_from_above(d, total.N, "z_d⁗")
    return (total.E[0], total.E[1])


def _draw_integrators(d: Drawing, start: Point) -> None:
    """Draw four integrators after `start`; their outputs return to the sum of the error."""
    x = start[0] + 1.0
    at = start
    bus = -1.9
    taps = []
    label(d, (start[0] + 0.45, 0.3), "v")
    for name in DERIVATIVES:
        box = integrator(d, (x + 0.45, 0.0))
        signal(d, at, box.W)
        tap = x + 1.45
        taps.append(tap)
        branch(d, (tap, 0.0))
        signal(d, (tap, 0.0), (tap, bus))
        label(d, (tap, 0.38), name)
        at = box.E
        x += 2.0
    signal(d, at, (taps[-1] + 1.2, 0.0))
    signal(d, (taps[0] - 0.3, bus), (taps[-1] + 0.3, bus), arrow=None, lw=BUS)
    signal(d, (taps[0] - 0.3, bus), (ERROR_X, bus), (ERROR_X, -0.2))
    label(d, (4.8, bus + 0.32), "z … z⃛")
