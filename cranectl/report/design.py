"""Tables and figures of designs: gains, margins and poles; singular values, loops, step responses."""

import math
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from typing import Any

import control
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cranectl.controllers import Controller, LinearController
from cranectl.design import (
    ControllerDesign,
    Design,
    Margins,
    closed_loop_poles,
    error_weight,
)
from cranectl.report.table import Cell, Table
from cranectl.report.theme import Chart
from cranectl.scenario import DesignSettings
from cranectl.support import Array

ROUNDING = 1e4  # the largest observed factor by which poles that nearly coincide amplify rounding
OMEGA = np.logspace(-2, 3, 800)  # [rad/s]
STEP_TIME = np.linspace(0.0, 8.0, 801)  # [s]
FREQUENCY = "angular frequency [rad/s]"
GAINS = ("loop gains", FREQUENCY, "magnitude")  # titles of three panels, their axes
INITIAL = ("initial error", "time [s]", "error [m]")
DISTURBED = ("disturbance of 1 m/s⁴ on v", "time [s]", "displacement [mm]")


class DesignReport:
    """Tables and figures of designs of controllers, one axis each."""

    @staticmethod
    def tables(design: Design) -> tuple[Table, Table]:
        """Return a table of a design's numbers, and one of its poles."""
        what = "of [W_s S; W_ks K S]"
        if design.stability_margin is not None:
            what = "coprime factors of the shaped loop"
        gammas = (
            ("gamma", design.gamma, f"smallest possible, {what}"),
            ("gamma achieved", design.gamma_achieved, "by this robustifier"),
            ("stability margin", design.stability_margin, "1 / gamma achieved"),
        )
        figures = (
            ("gain k0 … k3", "  ".join(f"{gain:.6g}" for gain in design.gain), "on e and three derivatives"),
            *((name, f"{value:.5f}", text) for name, value, text in gammas if value is not None),
            *_margin_rows(design.margins),
        )
        both = map(_poles, (design.closed_loop_poles, np.linalg.eigvals(design.robustifier.a)))
        poles = zip_longest(*both, fillvalue="")
        return (
            Table(
                f"{design.name}, one axis", ("", "", ""), tuple(Cell.row(*row) for row in figures), labels=3
            ),
            Table(
                "Poles [1/s]",
                ("closed loop", "robustifier"),
                tuple(Cell.row(*row) for row in poles),
                labels=2,
            ),
        )

    @staticmethod
    def comparison_table(designs: Sequence[Design]) -> Table:
        """Return a table of several designs, a column for each."""
        rows = [
            (f"gain k{k} [1/s{'⁴³²'[k] if k < 3 else ''}]", *(f"{design.gain[k]:.6g}" for design in designs))
            for k in range(4)
        ]
        rows += _beside(design.margins for design in designs)
        rows += _pole_rows(design.closed_loop_poles for design in designs)
        headings = ("one axis", *(design.name for design in designs))
        return Table("Designs", headings, tuple(Cell.row(*row) for row in rows), labels=1 + len(designs))

    @staticmethod
    def controller_tables(
        design: ControllerDesign, controller: Controller, linear: Sequence[LinearController]
    ) -> tuple[Table, ...]:
        """Return tables of a controller's parameters and, if known, of its linear loops at some ropes."""
        rows = []
        for parameter in controller.parameters:
            value = design.parameters[parameter.name]
            text = value if isinstance(value, str) else f"{value:g}"
            rows.append(Cell.row(parameter.name, text, parameter.unit, parameter.description))
        title = f"{design.name}: {controller.title}"
        tables = [Table(title, ("parameter", "", "", ""), tuple(rows), labels=4)]
        if linear:
            loops = [control.ss(model.a, model.b, model.gain.reshape(1, -1), 0.0) for model in linear]
            lines = [("gain", *("  ".join(f"{value:.4g}" for value in model.gain) for model in linear))]
            lines += _pole_rows(closed_loop_poles(loop) for loop in loops)
            lines += _beside(map(Margins.of, loops))
            headings = ("one horizontal axis", *(f"rope of {model.rope_length:g} m" for model in linear))
            title = "Linearised about rest, loop opened at the drive's acceleration"
            tables.append(
                Table(title, headings, tuple(Cell.row(*line) for line in lines), labels=1 + len(linear))
            )
        return tuple(tables)

    @staticmethod
    def figure(design: Design) -> Figure:
        """Draw sensitivities, loop gains and two responses of the loop of one axis."""
        loop, inner = design.open_loop(), design.inner_loop()(1j * OMEGA)
        figure, panels = Chart.canvas(10.0, 7.5, 2, 2)
        figure.suptitle(f"{design.name}, one axis")
        sensitivities, gains, initial, disturbed = panels.flat
        _draw_sensitivities(sensitivities, loop)
        gains.loglog(OMEGA, np.abs(loop(1j * OMEGA)), label="loop cut at v")
        gains.loglog(OMEGA, np.abs(inner), "--", label="G, v̄ to z")
        if design.robustifier.order:
            gains.loglog(
                OMEGA, np.abs(inner * design.robustifier.system()(1j * OMEGA)), label="G K, robustified"
            )
        gains.axhline(1.0, color="0.6", linewidth=0.8)
        off, pushed = _responses(loop)
        initial.plot(STEP_TIME, off, label="z, from 1 m off")
        disturbed.plot(STEP_TIME, pushed * 1e3, label="z, step on v")
        for axes, labels in ((gains, GAINS), (initial, INITIAL), (disturbed, DISTURBED)):
            _label(axes, *labels, legend=True)
        return figure

    @staticmethod
    def comparison_figure(designs: Sequence[Design]) -> Figure:
        """Draw several designs on top of each other, each in its colour."""
        figure, panels = Chart.canvas(10.0, 7.9, 2, 2)
        sensitivities, gains, initial, disturbed = panels.flat
        for k, design in enumerate(designs):
            loop, colour = design.open_loop(), f"C{k}"
            response = loop(1j * OMEGA)
            sensitivities.loglog(OMEGA, np.abs(1.0 / (1.0 + response)), color=colour)
            sensitivities.loglog(OMEGA, np.abs(response / (1.0 + response)), "--", color=colour)
            gains.loglog(OMEGA, np.abs(response), color=colour)
            off, pushed = _responses(loop)
            initial.plot(STEP_TIME, off, color=colour)
            disturbed.plot(STEP_TIME, pushed * 1e3, color=colour, label=design.name)
        gains.axhline(1.0, color="0.6", linewidth=0.8)
        _label(sensitivities, "loop cut at v: |S|, dashed |T|", FREQUENCY, "magnitude")
        for axes, labels in ((gains, GAINS), (initial, INITIAL), (disturbed, DISTURBED)):
            _label(axes, *labels)
        figure.suptitle("one axis")
        figure.legend(loc="outside lower center", ncols=3, frameon=False)
        return figure

    @staticmethod
    def loop_shaping_figure(design: Design, settings: DesignSettings) -> Figure:
        """Draw the inner loop, its weight, the shaped and the robustified loop, and the sensitivities."""
        robustifier = design.robustifier.system()
        inner, weight = (system(1j * OMEGA) for system in (design.inner_loop(), error_weight(settings)))
        figure, (shapes, sensitivities) = Chart.canvas(Chart.WIDTH, 5.4, 2, 1, sharex=True)
        for values, style, label in (
            (inner, {"linestyle": (0, (4, 2))}, "G, v̄ to z"),
            (weight, {"linestyle": (0, (1, 1.5))}, "weight W_e"),
            (inner * weight, {"linewidth": 3.5, "alpha": 0.4}, "shaped, G W_e"),
            (inner * robustifier(1j * OMEGA), {}, "robustified, G K"),
        ):
            shapes.loglog(OMEGA, np.abs(values), label=label, **style)
        shapes.axhline(1.0, color=matplotlib.rcParams["axes.edgecolor"], linewidth=0.8)
        _label(shapes, "singular values of one axis", "", "magnitude", legend=True)
        shapes.set_ylim(1e-5, 1e5)
        _draw_sensitivities(sensitivities, design.open_loop())
        sensitivities.set_ylim(1e-5, 1e1)
        return figure


def _pole_rows(poles: Iterable[NDArray[Any]]) -> list[tuple[str, ...]]:
    """Return the poles of several loops, a column each."""
    columns = zip_longest(*map(_poles, poles), fillvalue="")
    return [(f"pole {k} [1/s]", *row) for k, row in enumerate(columns, 1)]


def _margin_rows(margins: Margins) -> tuple[tuple[str, str, str], ...]:
    return (
        ("gain margin", f"{margins.gain_margin:.3f}", "factor on the loop gain that destabilises"),
        ("phase margin", f"{math.degrees(margins.phase_margin):.1f}°", "at the crossover"),
        ("disk margin", f"{margins.disk_margin:.3f}", "balanced S - T: gain and phase together"),
        ("modulus margin", f"{margins.modulus_margin:.3f}", "distance of the loop from -1"),
        ("peak of S", f"{margins.sensitivity_peak:.3f}", ""),
        ("peak of T", f"{margins.complementary_peak:.3f}", ""),
        ("crossover", f"{margins.crossover:.2f} rad/s", "loop gain 1"),
        ("bandwidth", f"{margins.bandwidth:.2f} rad/s", "T 3 dB below 1"),
    )


def _beside(margins: Iterable[Margins]) -> list[tuple[str, ...]]:
    """Return the margins of several loops, a column each."""
    rows = zip(*map(_margin_rows, margins), strict=True)
    return [(row[0][0], *(text for _, text, _ in row)) for row in rows]


def _poles(poles: NDArray[Any]) -> list[str]:
    """Return the poles as text, the slowest first, multiple ones once."""
    texts = []
    for pole, count in sorted(distinct_poles(poles), key=lambda pole: (-pole[0].real, pole[0].imag)):
        imaginary = f" {pole.imag:+.4g}i" if pole.imag else ""
        multiple = {1: "", 2: " (twice)"}.get(count, f" ({count} times)")
        texts.append(f"{pole.real:.4g}{imaginary}{multiple}")
    return texts


def distinct_poles(poles: NDArray[Any]) -> list[tuple[complex, int]]:
    """Return computed poles with their multiplicities, without imaginary parts due to rounding.

    Rounding by eps splits an m-fold root into m roots, about the m-th root of eps away in all directions.
    It hardly moves their mean. So m poles within (1e4 eps)^(1/m) of their mean, relative to it, are one.
    """
    left, distinct = np.asarray(poles, dtype=complex), []
    while len(left):
        for m in range(len(left), 0, -1):
            group = np.argsort(np.abs(left - left[0]), kind="stable")[:m]
            mean, known = left[group].mean(), (ROUNDING * np.finfo(float).eps) ** (1.0 / m)
            if np.abs(left[group] - mean).max() <= known * abs(mean):
                break
        real = abs(mean.imag) <= known * abs(mean)
        distinct.append((complex(mean.real if real else mean), m))
        left = np.delete(left, group)
    return distinct


def _draw_sensitivities(axes: Axes, loop: control.StateSpace) -> None:
    response = loop(1j * OMEGA)
    for values, label in ((1.0 / (1.0 + response), "S"), (response / (1.0 + response), "T")):
        axes.loglog(OMEGA, np.abs(values), label=f"|{label}|, peak {np.abs(values).max():.2f}")
    _label(axes, "loop cut at v: sensitivities", FREQUENCY, "magnitude", legend=True)


def _responses(loop: control.StateSpace) -> tuple[Array, Array]:
    """Return the load [m] at STEP_TIME after an error of 1 m, and after a step of 1 m/s⁴ on v."""
    unit = np.eye(loop.nstates)
    closed = control.ss(loop.A - loop.B @ loop.C, loop.B, unit[:1], 0.0)
    off = control.initial_response(closed, STEP_TIME, unit[0])
    pushed = control.step_response(closed, STEP_TIME)
    return np.squeeze(off.outputs), np.squeeze(pushed.outputs)


def _label(axes: Axes, title: str, x_label: str, y_label: str, *, legend: bool = False) -> None:
    axes.set(title=title, xlabel=x_label, ylabel=y_label)
    axes.grid(visible=True, which="major", linewidth=0.4)
    if legend:
        axes.legend(frameon=False)
