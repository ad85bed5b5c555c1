"""Picture of a certificate: gaps over rope length, and the worst point over frequency, against the margin."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cranectl.analysis.certificate.certify import Certificate, NominalLoop
from cranectl.analysis.certificate.loop import InnerLoop
from cranectl.analysis.certificate.nu_gap import complement, distance, orthonormal, sines
from cranectl.support.colours import LIGHT

SERIES = tuple(role for role in LIGHT if role.startswith("series"))
STYLES = ("-", "--", ":", "-.")
MARKS = {"gap": "o", "by frequency": "s", "refused": "x"}
LOWEST = 1e-2  # [rad/s]


def certificate_figure(
    found: Certificate, nominal_loop: NominalLoop, worst: InnerLoop, *, colours: Mapping[str, str] = LIGHT
) -> Figure:
    """The map on the left, on the right the worst point, where the loop is `worst`; `colours` by role."""
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    figure.suptitle(f"{found.controller}, {found.drive} drives, delay {1e3 * found.delay:g} ms")
    left, right = figure.subplots(1, 2)
    _draw_map(left, found, colours)
    _draw_frequency(right, found, nominal_loop, worst, colours)
    return figure


def _draw_map(axes: Axes, found: Certificate, colours: Mapping[str, str]) -> None:
    tilts = list(dict.fromkeys(verdict.point.tilt for verdict in found.points))
    speeds = list(dict.fromkeys(verdict.point.hoisting_speed for verdict in found.points))
    for i, tilt in enumerate(tilts):
        for j, speed in enumerate(speeds):
            line = [v for v in found.points if (v.point.tilt, v.point.hoisting_speed) == (tilt, speed)]
            lengths, gaps = [v.point.rope_length for v in line], [v.gap for v in line]
            colour = colours[SERIES[i % len(SERIES)]]
            label = f"{tilt[0]:g}, {tilt[1]:g} rad/s²; {speed:+g} m/s"
            axes.plot(lengths, gaps, STYLES[j % len(STYLES)], color=colour, linewidth=1.0, label=label)
            for verdict in line:
                axes.plot(
                    verdict.point.rope_length, verdict.gap, MARKS[verdict.grade], color=colour, markersize=4
                )
    axes.axhline(found.margin, color=colours["limit"], label=f"margin b = {found.margin:.3f}")
    axes.set(title="ν-gap; ○ certified, □ by frequency, × refused", xlabel="rope length [m]", ylabel="ν-gap")
    _finish(axes)


def _draw_frequency(
    axes: Axes, found: Certificate, nominal_loop: NominalLoop, worst: InnerLoop, colours: Mapping[str, str]
) -> None:
    omega = np.geomspace(LOWEST, np.pi / nominal_loop.period, 600)
    z = np.exp(1j * omega * nominal_loop.period)
    run = orthonormal(nominal_loop.cut.graph(worst).response(z))
    model = orthonormal(nominal_loop.graph.response(z))
    axes.semilogx(omega, distance(run, model), color=colours[SERIES[0]], label="distance to the design model")
    margin = sines(complement(nominal_loop.cut.controller(z)), model)
    axes.semilogx(omega, margin, color=colours["limit"], label="margin of the loop")
    axes.set(
        title=f"worst: {found.worst.point}", xlabel="angular frequency [rad/s]", ylabel="sine of the angle"
    )
    axes.title.set_fontsize(9)
    _finish(axes)


def _finish(axes: Axes) -> None:
    axes.set_ylim(0.0, 1.02)
    axes.grid(visible=True, linewidth=0.4)
    axes.legend(frameon=False, fontsize=7.5)
