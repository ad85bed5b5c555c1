"""Figures of designs: singular values, shaped loops, step responses."""

from collections.abc import Sequence

import control
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cranectl.design import Design
from cranectl.design.linear_systems import inner_loop, open_loop
from cranectl.design.loop_shaping import error_weight
from cranectl.report.theme import WIDTH, canvas
from cranectl.scenario.design import LoopShapingSettings
from cranectl.support.arrays import Array

OMEGA = np.logspace(-2, 3, 800)  # [rad/s]
STEP_TIME = np.linspace(0.0, 8.0, 801)  # [s]
FREQUENCY = "angular frequency [rad/s]"
INITIAL = ("initial error", "time [s]", "error [m]")  # titles of two panels, their axes
DISTURBED = ("disturbance of 1 m/s⁴ on v", "time [s]", "displacement [mm]")


def design_figure(design: Design) -> Figure:
    """Draw sensitivities, loop gains and two responses of the loop of one axis."""
    loop, inner = open_loop(design.gain, design.robustifier.system()), inner_loop(design.gain)(1j * OMEGA)
    figure, panels = canvas(10.0, 7.5, 2, 2)
    figure.suptitle(f"{design.name}, one axis")
    sensitivities, gains, initial, disturbed = panels.flat
    _draw_sensitivities(sensitivities, loop)
    gains.loglog(OMEGA, np.abs(loop(1j * OMEGA)), label="loop cut at v")
    gains.loglog(OMEGA, np.abs(inner), "--", label="G, v̄ to z")
    if design.robustifier.order:
        gains.loglog(OMEGA, np.abs(inner * design.robustifier.system()(1j * OMEGA)), label="G K, robustified")
    gains.axhline(1.0, color="0.6", linewidth=0.8)
    off, pushed = _responses(loop)
    initial.plot(STEP_TIME, off, label="z, from 1 m off")
    disturbed.plot(STEP_TIME, pushed * 1e3, label="z, step on v")
    _finish(gains, "loop gains", FREQUENCY, "magnitude")
    _finish(initial, *INITIAL)
    _finish(disturbed, *DISTURBED)
    return figure


def designs_figure(designs: Sequence[Design]) -> Figure:
    """Draw several designs on top of each other, a colour each."""
    figure, panels = canvas(10.0, 7.9, 2, 2)
    sensitivities, gains, initial, disturbed = panels.flat
    for k, design in enumerate(designs):
        loop, colour = open_loop(design.gain, design.robustifier.system()), f"C{k}"
        response = loop(1j * OMEGA)
        sensitivities.loglog(OMEGA, np.abs(1.0 / (1.0 + response)), color=colour)
        sensitivities.loglog(OMEGA, np.abs(response / (1.0 + response)), "--", color=colour)
        gains.loglog(OMEGA, np.abs(response), color=colour)
        off, pushed = _responses(loop)
        initial.plot(STEP_TIME, off, color=colour)
        disturbed.plot(STEP_TIME, pushed * 1e3, color=colour, label=design.name)
    gains.axhline(1.0, color="0.6", linewidth=0.8)
    _label(sensitivities, "loop cut at v: |S|, dashed |T|", FREQUENCY, "magnitude")
    _label(gains, "loop gains", FREQUENCY, "magnitude")
    _label(initial, *INITIAL)
    _label(disturbed, *DISTURBED)
    figure.suptitle("one axis")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def loop_shaping_figure(design: Design, settings: LoopShapingSettings) -> Figure:
    """Draw how the weight shapes the inner loop, what robustification leaves of it, and sensitivities."""
    robustifier = design.robustifier.system()
    inner, weight = (system(1j * OMEGA) for system in (inner_loop(design.gain), error_weight(settings)))
    figure, (shapes, sensitivities) = canvas(WIDTH, 5.4, 2, 1, sharex=True)
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


def _responses(loop: control.StateSpace) -> tuple[Array, Array]:
    """Return the load [m] at STEP_TIME after an error of 1 m, and after a step of 1 m/s⁴ on v."""
    unit = np.eye(loop.nstates)
    closed = control.ss(loop.A - loop.B @ loop.C, loop.B, unit[:1], 0.0)
    off = control.initial_response(closed, STEP_TIME, unit[0])
    pushed = control.step_response(closed, STEP_TIME)
    return np.squeeze(off.outputs), np.squeeze(pushed.outputs)


def _finish(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    _label(axes, title, x_label, y_label)
    axes.legend(frameon=False)


def _label(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    axes.set(title=title, xlabel=x_label, ylabel=y_label)
    axes.grid(visible=True, which="major", linewidth=0.4)
