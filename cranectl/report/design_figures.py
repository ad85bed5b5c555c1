"""Figures of designs: singular values, shaped loops, step responses."""

import control
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cranectl.design import Design
from cranectl.design.linear_systems import inner_loop, open_loop
from cranectl.design.loop_shaping import error_weight
from cranectl.scenario import LoopShapingSettings

OMEGA = np.logspace(-2, 3, 800)  # [rad/s]
STEP_TIME = np.linspace(0.0, 8.0, 801)  # [s]
FREQUENCY = "angular frequency [rad/s]"


def design_figure(design: Design) -> Figure:
    """Sensitivities, loop gains and two responses of the loop of one axis."""
    loop = open_loop(design.gain, design.robustifier.system())
    figure = Figure(figsize=(10.0, 7.5), layout="constrained")
    figure.suptitle(f"{design.name}, one axis")
    sensitivities, shaped, initial, disturbed = figure.subplots(2, 2).flat
    _draw_sensitivities(sensitivities, loop)
    _draw_loops(shaped, design, loop)
    _draw_responses(initial, disturbed, loop)
    return figure


def loop_shaping_figure(design: Design, settings: LoopShapingSettings) -> Figure:
    """How the weight shapes the inner loop and what robustification leaves of the shape; sensitivities."""
    robustifier = design.robustifier.system()
    inner, weight = (system(1j * OMEGA) for system in (inner_loop(design.gain), error_weight(settings)))
    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    shapes, sensitivities = figure.subplots(2, 1, sharex=True)
    for values, style, label in (
        (inner, {"linestyle": (0, (4, 2))}, "G, v̄ to z"),
        (weight, {"linestyle": (0, (1, 1.5))}, "weight W_e"),
        (inner * weight, {"linewidth": 3.5, "alpha": 0.4}, "shaped, G W_e"),
        (inner * robustifier(1j * OMEGA), {}, "robustified, G K"),
    ):
        shapes.loglog(OMEGA, np.abs(values), label=label, **style)
    shapes.axhline(1.0, color=matplotlib.rcParams["axes.edgecolor"], linewidth=0.8)
    _finish(shapes, "singular values of one axis", "", "magnitude")
    shapes.set_ylim(1e-5, 1e5)
    _draw_sensitivities(sensitivities, open_loop(design.gain, robustifier))
    sensitivities.set_ylim(1e-5, 1e1)
    return figure


def _draw_sensitivities(axes: Axes, loop: control.StateSpace) -> None:
    response = loop(1j * OMEGA)
    for values, label in ((1.0 / (1.0 + response), "S"), (response / (1.0 + response), "T")):
        axes.loglog(OMEGA, np.abs(values), label=f"|{label}|, peak {np.abs(values).max():.2f}")
    _finish(axes, "loop cut at v: sensitivities", FREQUENCY, "magnitude")


def _draw_loops(axes: Axes, design: Design, loop: control.StateSpace) -> None:
    inner = inner_loop(design.gain)(1j * OMEGA)
    axes.loglog(OMEGA, np.abs(loop(1j * OMEGA)), label="loop cut at v")
    axes.loglog(OMEGA, np.abs(inner), "--", label="G, v̄ to z")
    if design.robustifier.order:
        axes.loglog(OMEGA, np.abs(inner * design.robustifier.system()(1j * OMEGA)), label="G K, robustified")
    axes.axhline(1.0, color="0.6", linewidth=0.8)
    _finish(axes, "loop gains", FREQUENCY, "magnitude")


def _draw_responses(initial: Axes, disturbed: Axes, loop: control.StateSpace) -> None:
    """Of the load to an error of 1 m at the start, all else at rest, and to a step of 1 m/s⁴ added to v."""
    unit = np.eye(loop.nstates)
    closed = control.ss(loop.A - loop.B @ loop.C, loop.B, unit[:1], 0.0)
    response = control.initial_response(closed, STEP_TIME, unit[0])
    initial.plot(response.time, np.squeeze(response.outputs), label="z, from 1 m off")
    _finish(initial, "initial error", "time [s]", "error [m]")
    response = control.step_response(closed, STEP_TIME)
    disturbed.plot(response.time, np.squeeze(response.outputs) * 1e3, label="z, step on v")
    _finish(disturbed, "disturbance of 1 m/s⁴ on v", "time [s]", "displacement [mm]")


def _finish(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    axes.set(title=title, xlabel=x_label, ylabel=y_label)
    axes.grid(visible=True, which="major", linewidth=0.4)
    axes.legend(frameon=False)
