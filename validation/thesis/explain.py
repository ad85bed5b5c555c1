"""Test hypotheses on why our Tables 5.1 and 5.3 differ from those of the thesis.

    python validation/thesis/explain.py                  all hypotheses, under two minutes
    python validation/thesis/explain.py --cells best all numbers of the hypotheses whose names contain this
    python validation/thesis/explain.py --noise the noise that Simulink's default solver adds

The loop is simulated in continuous time, as the thesis's Simulink model was. It has compiled functions of its
own, in which each term of plant and linearising law can be wrong. The score of a column is the root mean
square of its deviations from print over the six controllers, relative for accelerations and in mm for
positions.

The hypothesis `best` reads the rope's peak of Table 5.1 after the second step, at 12 s, and designs S/KS for
the printed gammas. Each later hypothesis changes one thing in `best`.
"""

import argparse
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.design import design_controller
from cranectl.design.mixed_sensitivity import hinf_robustifier
from cranectl.model.flatness import flat_output, slopes_from_angles
from cranectl.planning import load_scenario
from cranectl.reference import Trajectory
from cranectl.scenario import Scenario
from cranectl.support.jit import jit
from cranectl.support.resources import Shipped
from cranectl.tools.thesis.reproduction import CONTROLLERS

Array = NDArray[np.float64]

TABLE_STEP = 1e-3  # [s] between samples of references and disturbances
MAX_STEP = 2e-3  # [s] of the fixed-step solver; a stiff robustifier needs shorter steps
DISTURBANCE_TIMES = (6.0, 12.0)  # [s] of the steps of d_alpha and d_beta
READING_TIME = 20.0  # [s] of Tables 5.3 and 5.4

# Factors of the terms of (2.12): 2 l a' b' sin b, 2 l' a' cos b; 2 l' b', l a'^2 sin b cos b, sin a sin b
# y_c''; and of the printed terms 2 l a' and 2 l b'.
CORRECT_TERMS = (1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0)


class Loop(NamedTuple):
    """Plant, linearising law, feedback and robustifier in continuous time."""

    gain: Array  # (4,) of the feedback
    a: Array
    b: Array
    c: Array
    d: float  # a, b, c, d: robustifier of an axis
    robustified: Array  # (3,) factor of v-bar by axis
    plant: Array  # factors of the terms of (2.12) in the plant, see CORRECT_TERMS
    law: Array  # factors of the same terms in the linearising law
    zeta_terms: Array  # (2,) factors of zeta' in z''', and of zeta in z'' and z'''
    gravity: Array  # (2,) of plant and linearising law [m/s²]
    torque: float  # 1: (2.12) divides the disturbance by l cos b or l; 0: it is added to a'', b''
    reference: Array  # (N, 15), every TABLE_STEP
    disturbance: Array  # (N, 2) of a'' and b''


@jit
def coriolis(terms, state, rate_y):
    """Return the numerators of (2.12) without gravity and without the drive of the same axis."""
    length, length_rate, a_dot, b, b_dot = state[4], state[5], state[7], state[8], state[9]
    alpha = 2.0 * length * a_dot * b_dot * sin(b) * terms[0] - 2.0 * length_rate * a_dot * cos(b) * terms[1]
    alpha -= 2.0 * length * a_dot * terms[5]
    beta = -2.0 * length_rate * b_dot * terms[2] - length * a_dot * a_dot * sin(b) * cos(b) * terms[3]
    beta += sin(state[6]) * sin(b) * rate_y * terms[4] - 2.0 * length * b_dot * terms[6]
    return alpha, beta


@jit
def derivative(loop, t, x, dx, out):
    """Compute the derivative `dx` of the states: plant (10), zeta, zeta', robustifiers of three axes.

    `out` (6,) receives the drives' accelerations and the load's position.
    """
    order = loop.a.shape[0]
    position = (t + 1e-10) / TABLE_STEP
    row = int(position)
    last = loop.reference.shape[0] - 1
    row = min(row, last)
    following, weight = min(row + 1, last), position - row
    length, a, a_dot, b, b_dot, zeta, zeta_dot = x[4], x[6], x[7], x[8], x[9], x[10], x[11]
    sa, ca, sb, cb = sin(a), cos(a), sin(b), cos(b)
    g_plant, g_law = loop.gravity[0], loop.gravity[1]
    flat, v = np.zeros(15), np.zeros(3)
    p_x, p_y, p_x_dot, p_y_dot = slopes_from_angles(a, a_dot, b, b_dot)
    flat_output(x[:10], zeta, zeta_dot, g_law, flat)
    flat[9] += (1.0 - loop.zeta_terms[0]) * p_x * zeta_dot
    flat[10] += (1.0 - loop.zeta_terms[0]) * p_y * zeta_dot
    for k in (6, 7, 9, 10):
        flat[k] *= (loop.zeta_terms[1] * zeta + g_law) / (zeta + g_law)
    for axis in range(3):
        for k in range(5):
            desired = (1.0 - weight) * loop.reference[row, 3 * k + axis]
            desired += weight * loop.reference[following, 3 * k + axis]
            if k == 4:
                v[axis] += desired
            else:
                v[axis] += loop.gain[k] * (desired - flat[3 * k + axis])
            if k == 0:
                error = desired - flat[axis]
        first = 12 + axis * order
        v_bar = loop.d * error
        for i in range(order):
            v_bar += loop.c[i] * x[first + i]
            dx[first + i] = loop.b[i] * error
            for j in range(order):
                dx[first + i] += loop.a[i, j] * x[first + j]
        v[axis] += loop.robustified[axis] * v_bar
    # The linearising law: angular accelerations that give v, then drives that give them by its terms of
    # (2.12).
    lift = zeta + g_law
    p_x_ddot = -(v[0] + 2.0 * p_x_dot * zeta_dot + p_x * v[2]) / lift
    p_y_ddot = -(v[1] + 2.0 * p_y_dot * zeta_dot + p_y * v[2]) / lift
    a_ddot = p_y_ddot * ca * ca - 2.0 * p_y * a_dot * a_dot
    secant_dot = p_y * a_dot / ca
    secant_ddot = (p_y * a_ddot + a_dot * a_dot * (p_y * p_y + 1.0 / (ca * ca))) / ca
    tan_b_ddot = (p_x_ddot - 2.0 * b_dot / (cb * cb) * secant_dot - tan(b) * secant_ddot) * ca
    b_ddot = tan_b_ddot * cb * cb - 2.0 * tan(b) * b_dot * b_dot
    alpha_terms, _ = coriolis(loop.law, x, 0.0)
    u_y = -(a_ddot * length * cb + g_law * sa - alpha_terms) / ca
    _, beta_terms = coriolis(loop.law, x, u_y)
    u_x = -(b_ddot * length + g_law * ca * sb - beta_terms) / cb
    u_l = -lift / (ca * cb) - u_x * sb - u_y * sa * cb + g_law * ca * cb
    u_l += length * (a_dot * a_dot * cb * cb + b_dot * b_dot)
    # The plant.
    alpha_terms, beta_terms = coriolis(loop.plant, x, u_y)
    d_a, d_b = loop.disturbance[row, 0], loop.disturbance[row, 1]
    d_a, d_b = (
        d_a * (1.0 + loop.torque * (1.0 / (length * cb) - 1.0)),
        d_b * (1.0 + loop.torque * (1.0 / length - 1.0)),
    )
    dx[0], dx[1], dx[2], dx[3], dx[4], dx[5] = x[1], u_x, x[3], u_y, x[5], u_l
    dx[6], dx[7] = a_dot, (alpha_terms - g_plant * sa - ca * u_y) / (length * cb) + d_a
    dx[8], dx[9] = b_dot, (beta_terms - g_plant * ca * sb - cb * u_x) / length + d_b
    dx[10], dx[11] = zeta_dot, v[2]
    out[0], out[1], out[2] = u_x, u_y, u_l
    out[3], out[4], out[5] = flat[0], flat[1], flat[2]


@jit
def start(loop):
    """Return the state at rest at the start of the reference."""
    x = np.zeros(12 + 3 * loop.a.shape[0])
    x[0], x[2], x[4] = loop.reference[0, 0], loop.reference[0, 1], -loop.reference[0, 2]
    return x


@jit
def fixed_step(loop, end, step):
    """Integrate by the classical Runge-Kutta method; return rows of time, accelerations and load (N, 7)."""
    x, rows = start(loop), np.zeros((round(end / step) + 1, 7))
    k_1, k_2, k_3, k_4 = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    scratch = np.zeros(6)
    for k in range(len(rows)):
        t = k * step
        rows[k, 0] = t
        derivative(loop, t, x, k_1, rows[k, 1:])
        derivative(loop, t + 0.5 * step, x + 0.5 * step * k_1, k_2, scratch)
        derivative(loop, t + 0.5 * step, x + 0.5 * step * k_2, k_3, scratch)
        derivative(loop, t + step - 1e-9, x + step * k_3, k_4, scratch)  # a jump belongs to the next step
        x += step / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
    return rows


# Coefficients of the method of Dormand and Prince.
STAGES = np.zeros((7, 7))
STAGES[1, 0] = 1 / 5
STAGES[2, :2] = 3 / 40, 9 / 40
STAGES[3, :3] = 44 / 45, -56 / 15, 32 / 9
STAGES[4, :4] = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
STAGES[5, :5] = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
STAGES[6, :6] = 35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
NODES = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1])
ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


@jit
def ode45(loop, end, tolerance):
    """Integrate as Simulink's ode45 by default: automatic absolute tolerance, steps up to end / 50."""
    x, rows = start(loop), np.zeros((100_000, 7))
    k, scratch = np.zeros((7, len(x))), np.zeros(6)
    largest, t, step, count = np.abs(x), 0.0, end / 50.0, 1
    derivative(loop, t, x, k[0], rows[0, 1:])
    while t < end - 1e-9 and count < len(rows):
        largest = np.maximum(largest, np.abs(x))
        threshold = np.maximum(1e-6 / tolerance, largest)
        barrier = end
        for time in DISTURBANCE_TIMES:
            if t < time - 1e-9:
                barrier = min(barrier, time)
        step = min(step, end / 50.0)
        full_step, first_try = step, True
        while True:
            reaches_barrier = t + step >= barrier - 1e-9
            if reaches_barrier:
                step = barrier - t
            for s in range(1, 7):
                y = x.copy()
                for j in range(s):
                    y += step * STAGES[s, j] * k[j]
                early = 1e-9 if reaches_barrier and NODES[s] == 1.0 else 0.0
                derivative(loop, t + NODES[s] * step - early, y, k[s], scratch)
            error = 0.0
            for i in range(len(x)):
                e = 0.0
                for s in range(7):
                    e += ERROR[s] * k[s, i]
                error = max(error, abs(step * e) / max(abs(x[i]), abs(y[i]), threshold[i]))
            if error <= tolerance:
                break
            step *= max(0.1, 0.8 * (tolerance / error) ** 0.2) if first_try else 0.5
            first_try = False
        t, x = t + step, y
        derivative(loop, t, x, k[0], rows[count, 1:])
        rows[count, 0] = t
        count += 1
        if reaches_barrier:
            step = full_step
        elif first_try:
            step *= min(5.0, 1.0 / max(1e-9, 1.25 * (error / tolerance) ** 0.2))
    return rows[:count]


@dataclass(frozen=True)
class Hypothesis:
    """A difference between the thesis and `best`; the defaults are those of `best`."""

    name: str
    overrides: tuple[str, ...] = ()  # settings of both scenarios, as of `--set`
    back_off: float | None = None  # gamma of S/KS over its optimum; None: the printed gamma
    rope_from: float = DISTURBANCE_TIMES[1] - 2.0  # [s] start of the rope's column in Table 5.1
    plant: tuple[float, ...] = CORRECT_TERMS
    law: tuple[float, ...] = CORRECT_TERMS
    zeta_terms: tuple[float, float] = (1.0, 1.0)
    gravity: tuple[float, float] = (9.81, 9.81)
    torque: float = 0.0
    disturbance: tuple[float, float] = (1.0, 1.0)
    times: tuple[float, float] = DISTURBANCE_TIMES
    robustified: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gain_digits: int | None = None  # decimals to which gains are rounded
    reference: Callable[[Array], Array] | None = None  # changes the rows of the reference
    tolerance: float | None = None  # of ode45; None: fixed step
    modal: bool = True  # S/KS in modal form; False: as the synthesis returns it
    sampled: float | None = None  # [s] between the samples from which peaks are read; None: all


def terms(**wrong: float) -> tuple[float, ...]:
    """Return CORRECT_TERMS with the factors in `wrong` replaced."""
    names = ("ab", "hoist_a", "hoist_b", "centripetal", "cross", "printed_a", "printed_b")
    return tuple(wrong.get(name, factor) for name, factor in zip(names, CORRECT_TERMS, strict=True))


def scale_derivative(
    order: int, factor: float, axes: tuple[int, ...] = (0, 1, 2)
) -> Callable[[Array], Array]:
    """Return a function that scales one derivative of the reference."""

    def change(rows: Array) -> Array:
        changed = rows.copy()
        changed[:, [3 * order + axis for axis in axes]] *= factor
        return changed

    return change


def hold(period: float, orders: int) -> Callable[[Array], Array]:
    """Return a function that samples and holds the first `orders` derivatives of the reference."""
    n = round(period / TABLE_STEP)

    def change(rows: Array) -> Array:
        changed = rows.copy()
        changed[:, : 3 * orders] = rows[np.arange(len(rows)) // n * n, : 3 * orders]
        return changed

    return change


def interpolate(period: float) -> Callable[[Array], Array]:
    """Return a function that replaces positions of the reference by a polygon, and keeps the derivatives."""
    n = round(period / TABLE_STEP)

    def change(rows: Array) -> Array:
        changed, grid = rows.copy(), np.arange(0, len(rows), n)
        for axis in range(3):
            changed[:, axis] = np.interp(np.arange(len(rows)), grid, rows[grid, axis])
        return changed

    return change


def other_path(end_x: float, radius: float, half_turns: int) -> tuple[str, ...]:
    """Return settings of another settled trajectory, whose centre is at x = `end_x` - `radius`."""
    line = f"{{kind='line', to=[{end_x}, 0.77, -0.7], duration=10.0, time_law='degree-5'}}"
    arc = (
        f"{{kind='arc', centre=[{end_x - radius}, 0.77], angle={half_turns * np.pi}, duration=10.0, "
        "time_law='degree-5'}"
    )
    return (f"reference.segments=[{line}, {arc}]",)


H = Hypothesis
HYPOTHESES = (
    # The best explanation, and steps towards it.
    H("first guess: rope from 0 s, S/KS at 1.005", rope_from=0.0, back_off=1.005),
    H("rope after the second step", back_off=1.005),
    H("S/KS for the printed gammas", rope_from=0.0),
    H("best: both"),
    # Robustifiers.
    H("S/KS at 1.001", back_off=1.001),
    H("S/KS at 1.02", back_off=1.02),
    H("W_ks 1e-3", ("design.hinf.control_weight=1e-3",), back_off=1.005),
    H("W_ks 2e-4", ("design.hinf.control_weight=2e-4",), back_off=1.005),
    H("W_ks 5e-5, printed gammas", ("design.hinf.control_weight=5e-5",)),
    H("W_ks 1e-5, printed gammas", ("design.hinf.control_weight=1e-5",)),
    H("W_ks 1e-6, printed gammas", ("design.hinf.control_weight=1e-6",)),
    H("loop shaping at 1.0002", ("design.loop_shaping.back_off=1.0002",)),
    H("loop shaping at 1.01", ("design.loop_shaping.back_off=1.01",)),
    H("loop shaping at 1.1", ("design.loop_shaping.back_off=1.1",)),
    H("robustifier not on z", robustified=(1.0, 1.0, 0.0)),
    # Gains.
    H("gains rounded to integers", gain_digits=0),
    H("R 0.11", ("design.input_weight=0.11",)),
    # Plant and law.
    *(
        H(f"{where}: {what}", **dict.fromkeys(sides, value))
        for where, sides in (("plant", ("plant",)), ("law", ("law",)), ("both", ("plant", "law")))
        for what, value in (
            ("no 2 l' a' cos b", terms(hoist_a=0.0)),
            ("no 2 l' b'", terms(hoist_b=0.0)),
            ("no Coriolis at all", terms(ab=0.0, hoist_a=0.0, hoist_b=0.0, centripetal=0.0)),
            ("+ 2 l' a', + 2 l' b'", terms(hoist_a=-1.0, hoist_b=-1.0)),
            ("2 l a' as printed", terms(hoist_a=0.0, printed_a=1.0)),
            ("2 l b' as printed", terms(hoist_b=0.0, printed_b=1.0)),
            ("no sin a sin b y''", terms(cross=0.0)),
            ("- sin a sin b y''", terms(cross=-1.0)),
        )
    ),
    H("z''' without zeta'", zeta_terms=(0.0, 1.0)),
    H("z'' without zeta", zeta_terms=(1.0, 0.0)),
    H("gravity 9.8", gravity=(9.8, 9.8)),
    H("gravity 10", gravity=(10.0, 10.0)),
    H("gravity 9.8 in the plant only", gravity=(9.8, 9.81)),
    # Disturbances.
    H("disturbance divided by l", torque=1.0),
    H("d_alpha negative", disturbance=(-1.0, 1.0)),
    H("d_beta negative", disturbance=(1.0, -1.0)),
    H("both negative", disturbance=(-1.0, -1.0)),
    H("d_beta first", times=(12.0, 6.0)),
    H("d_beta at 12.2 s", times=(6.0, 12.2)),
    H("d_alpha at 9 s", times=(9.0, 12.0)),
    # Reference.
    H("no z_d''''", reference=scale_derivative(4, 0.0)),
    H("no z_d'''' in y", reference=scale_derivative(4, 0.0, (1,))),
    H(
        "no z_d''' and z_d''''",
        reference=lambda rows: scale_derivative(3, 0.0)(scale_derivative(4, 0.0)(rows)),
    ),
    H("y_d'' 9 % too large", reference=scale_derivative(2, 1.09, (1,))),
    H("reference held for 10 ms", reference=hold(0.01, 5)),
    H("position held for 10 ms", reference=hold(0.01, 1)),
    H("position a polygon of 50 ms", reference=interpolate(0.05)),
    H("counter-clockwise", other_path(1.65, 0.65, 2)),
    H("radius 0.6", other_path(1.65, 0.6, -2)),
    H("radius 0.64", other_path(1.65, 0.64, -2)),
    H("line to 0.6, turn about 1.25", other_path(0.6, -0.65, -2)),
    H("line to 0.6, turn about 1", other_path(0.6, -0.4, -2)),
    H("line to 0.6, half turn to 1.65", other_path(0.6, -0.525, -1)),
    H("line to 0.6, 1.5 turns to 1.65", other_path(0.6, -0.525, 3)),
    # Solver and reading.
    H("peaks from samples of 0.05 s", sampled=0.05),
    H("peaks from samples of 0.1 s", sampled=0.1),
    H("peaks from samples of 0.2 s", sampled=0.2),
    H("ode45, tolerance 1e-3", tolerance=1e-3),
    H("ode45, tolerance 1e-3, S/KS as synthesised", tolerance=1e-3, modal=False),
)


def printed() -> dict[str, Array]:
    """Return the printed tables by name, with rows in the order of CONTROLLERS."""
    tables = tomllib.loads((Shipped.THESIS_FOLDER / "printed.toml").read_text(encoding="utf-8"))["tables"]
    return {name: np.array([table["rows"][c] for c in CONTROLLERS]) for name, table in tables.items()}


def printed_gammas() -> dict[str, float]:
    """Return the printed norms of section 5.2.1 by controller."""
    norms = tomllib.loads((Shipped.THESIS_FOLDER / "printed.toml").read_text(encoding="utf-8"))["norms"]
    return {entry["controller"]: entry["gamma"] for entry in norms}


def simulate(hypothesis: Hypothesis, scenario: Scenario, controller: str) -> Array:
    """Simulate a controller under a hypothesis; return rows of time, accelerations and load (N, 7)."""
    h = hypothesis
    settings = scenario.design
    if controller.endswith("+hinf"):
        optimal = design_controller(controller, settings).gamma
        assert optimal is not None
        gamma = h.back_off * optimal if h.back_off else max(printed_gammas()[controller], 1.001 * optimal)
        settings = settings.model_copy(update={"hinf": settings.hinf.model_copy(update={"gamma": gamma})})
    design = design_controller(controller, settings)
    r, order = design.robustifier, design.robustifier.order
    a, b, c = r.a, r.b, r.c
    if controller.endswith("+hinf") and not h.modal:
        system = hinf_robustifier(design.gain, settings)[0]
        a, b, c = system.A, system.B.ravel(), system.C.ravel()
    time = np.arange(round(scenario.duration / TABLE_STEP) + 2) * TABLE_STEP
    rows = Trajectory.of(scenario.reference).sample(time)
    steps = [amount * (time > t - 1e-9) for amount, t in zip(h.disturbance, h.times, strict=True)]
    gain = design.gain if h.gain_digits is None else np.round(design.gain, h.gain_digits)
    loop = Loop(
        gain=np.ascontiguousarray(gain),
        a=np.ascontiguousarray(a).reshape(order, order),
        b=np.ascontiguousarray(b),
        c=np.ascontiguousarray(c),
        d=float(r.d),
        robustified=np.array(h.robustified),
        plant=np.array(h.plant),
        law=np.array(h.law),
        zeta_terms=np.array(h.zeta_terms),
        gravity=np.array(h.gravity),
        torque=h.torque,
        reference=np.ascontiguousarray(h.reference(rows) if h.reference else rows),
        disturbance=np.ascontiguousarray(np.array(steps).T),
    )
    if h.tolerance is not None:
        return ode45(loop, scenario.duration, h.tolerance)
    fastest = float(np.abs(np.linalg.eigvals(loop.a)).max(initial=1.0))
    return fixed_step(loop, scenario.duration, MAX_STEP / np.ceil(0.5 * MAX_STEP * fastest))


def read_tables(hypothesis: Hypothesis) -> dict[str, Array]:
    """Return Tables 5.1 to 5.4 under a hypothesis; a peak has the sign of the printed one."""
    print_tables = printed()
    tables = {name: np.zeros_like(table) for name, table in print_tables.items()}
    for name, peaks, positions in (("fixed-position", "5.1", "5.2"), ("settled-trajectory", "5.3", "5.4")):
        overrides = [o for o in hypothesis.overrides if peaks == "5.3" or not o.startswith("reference")]
        scenario = load_scenario(name, overrides=overrides)
        for i, controller in enumerate(CONTROLLERS):
            rows = simulate(hypothesis, scenario, controller)
            time, inputs, load = rows[:, 0], rows[:, 1:4], rows[:, 4:7]
            until = READING_TIME if peaks == "5.3" else scenario.duration
            tables[positions][i] = [np.interp(until, time, load[:, axis]) for axis in range(3)]
            if hypothesis.sampled:
                grid = np.arange(0.0, READING_TIME + 1e-9, hypothesis.sampled)
                inputs = np.array([np.interp(grid, time, inputs[:, axis]) for axis in range(3)]).T
                time = grid
            for axis in range(3):
                begin = hypothesis.rope_from if (peaks, axis) == ("5.1", 2) else 0.0
                values = inputs[(time >= begin) & (time <= READING_TIME + 1e-9), axis]
                is_maximum = print_tables[peaks][i, axis] > 0.0
                tables[peaks][i, axis] = values.max() if is_maximum else values.min()
    return tables


def deviations(tables: dict[str, Array]) -> dict[str, Array]:
    """Return deviations from print: relative for peaks [%], absolute for positions [mm]."""
    return {
        name: 100.0 * (tables[name] / table - 1.0) if name in ("5.1", "5.3") else 1e3 * (tables[name] - table)
        for name, table in printed().items()
    }


def _rms(values: Array) -> str:
    scores = np.sqrt((values**2).mean(axis=0))
    return " ".join(f"{score:6.2f}" if score < 999.0 else "   >1k" for score in scores)


PARTS = {"line": (1.0, 5.9), "arc": (13.0, 16.0), "rest": (23.0, 25.0)}  # [s] of the settled trajectory


def noise(controller: str, *, modal: bool) -> dict[str, Array]:
    """Return the largest errors (3,) of accelerations by ode45 [m/s²], by part of the trajectory."""
    scenario = load_scenario("settled-trajectory")
    exact = simulate(Hypothesis("exact"), scenario, controller)
    rows = simulate(Hypothesis("ode45", tolerance=1e-3, modal=modal), scenario, controller)
    expected = np.array([np.interp(rows[:, 0], exact[:, 0], exact[:, 1 + axis]) for axis in range(3)]).T
    errors = {}
    for part, (begin, end) in PARTS.items():
        selected = (rows[:, 0] > begin) & (rows[:, 0] < end)
        errors[part] = np.abs(rows[selected, 1:4] - expected[selected]).max(axis=0)
    return errors


def print_noise() -> None:
    """Print the solver's noise for every controller, with S/KS in both forms."""
    for controller in CONTROLLERS:
        for modal in (True, False) if controller.endswith("+hinf") else (True,):
            print(f"{controller}, {'modal form' if modal else 'as synthesised'}: x, y, l [m/s²]")
            for part, error in noise(controller, modal=modal).items():
                print(f"  {part:6}" + "  ".join(f"{e:7.4f}" for e in error))


def main() -> int:
    """Print the scores of hypotheses, or what the command line selects."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--cells", metavar="NAME", help="print all numbers of the hypotheses whose names contain NAME"
    )
    parser.add_argument("--noise", action="store_true", help="print the noise of ode45 instead")
    arguments = parser.parse_args()
    if arguments.noise:
        print_noise()
        return 0
    hypotheses = [h for h in HYPOTHESES if arguments.cells is None or arguments.cells in h.name]
    without_hinf = [i for i, name in enumerate(CONTROLLERS) if not name.endswith("+hinf")]
    headings = (
        "5.1 x, y, l [%]",
        "5.3 x, y, l [%]",
        "without S/KS [%]",
        "5.2 x, y, z [mm]",
        "5.4 x, y, z [mm]",
    )
    print(f"{'':42} " + "  ".join(f"{title:20}" for title in headings))
    for h in hypotheses:
        tables = read_tables(h)
        errors = deviations(tables)
        columns = (errors["5.1"], errors["5.3"], errors["5.3"][without_hinf], errors["5.2"], errors["5.4"])
        print(f"{h.name:42} " + "  ".join(_rms(values) for values in columns), flush=True)
        if arguments.cells is not None:
            for name, table in printed().items():
                for i, controller in enumerate(CONTROLLERS):
                    pairs = zip(table[i], tables[name][i], strict=True)
                    print(f"  {name} {controller:28} " + "  ".join(f"{p:8.4f} {o:8.4f}" for p, o in pairs))
    return 0


if __name__ == "__main__":
    sys.exit(main())
