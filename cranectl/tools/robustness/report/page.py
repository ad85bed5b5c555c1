"""The page of the fidelity ladder, and the figure of a certificate."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from cranectl.report import Chart, Figure, Page, Section
from cranectl.scenario import Scenario
from cranectl.support import Palette
from cranectl.tools.robustness.certificate.certify import Certificate, NominalLoop
from cranectl.tools.robustness.certificate.loop import InnerLoop
from cranectl.tools.robustness.certificate.nu_gap import complement, distance, orthonormal, smallest_sine
from cranectl.tools.robustness.ladder import LevelResult, load_difference
from cranectl.tools.robustness.levels import BASE
from cranectl.tools.robustness.report.tables import LadderTables

Loops = tuple[NominalLoop, InnerLoop]  # of a controller: with the design model, and at the worst point

MIN_DEVIATION = 1e-6  # [m], the smallest deviation in figures
EDGE = "At the left edge: 1 µm or less."
MIN_FREQUENCY = 1e-2  # [rad/s] of the frequencies in figures
STYLES = ("-", "--", ":", "-.")
MARKS = {"gap": "o", "by frequency": "s", "refused": "x"}


def ladder_page(scenario: Scenario, controller: str, results: Sequence[LevelResult], remade_by: str) -> Page:
    """Return the page on the cost of each effect with one controller, alone and on top of the others."""
    title = f"{scenario.name}, {controller}: the fidelity ladder"
    return Page(title, scenario.title, _ladder_sections(results), remade_by)


def _ladder_sections(results: Sequence[LevelResult]) -> tuple[Section, ...]:
    added = {result.level.name: result.cumulative.max for result in results if result.cumulative}
    alone = [result.alone.max if result.alone else np.nan for result in results if result.cumulative]
    figures: tuple[Figure, ...] = ()
    if added:  # else the first level is alone
        most, name = max((most, name) for name, most in added.items())
        largest = f"The largest step is {name}: the load moves by up to {1e3 * most:.3g} mm. {EDGE}"
        pair = {"on top of the levels before": [*added.values()], f"alone, on {BASE}": alone}
        distance = f"distance of the load from that of {results[0].level.name}"
        figures = (
            Figure.drawn("what each level adds", largest, deviation_dots, [*added], pair),
            Figure.drawn(distance, "", level_distances, results),
        )
    costs = (LadderTables.differences(results),)
    return (
        Section("costs", "What each effect costs", tables=costs, figures=figures),
        Section("levels", "The levels", tables=(LadderTables.levels(results),)),
    )


def deviation_dots(names: Sequence[str], pair: Mapping[str, Sequence[float]]) -> Drawing:
    """Draw two dots for each name, by label of their values [m]."""
    (drawing, axes), rows = Chart.canvas(Chart.WIDTH, 0.9 + 0.3 * len(names)), np.arange(len(names))
    for offset, role, marker, (label, values) in zip(
        (-0.1, 0.1), Chart.SERIES, "oD", pair.items(), strict=False
    ):
        style: dict[str, Any] = {
            "color": Chart.STAND_IN[role],
            "markersize": 5,
            "clip_on": False,
            "zorder": 3,
        }
        axes.plot(1e3 * np.maximum(values, MIN_DEVIATION), rows + offset, marker, label=label, **style)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set(xlim=(1e3 * MIN_DEVIATION, None), xlabel="largest deviation of the load [mm]")
    axes.set_yticks(rows, names)
    Chart.make_room(drawing, names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    drawing.legend(loc="outside upper center", ncols=3, columnspacing=Chart.spaced(axes.lines))
    return drawing


def level_distances(results: Sequence[LevelResult]) -> Drawing:
    """Draw the distance of each load from the first one's over time, solid, then dashed."""
    (drawing, axes), first = Chart.canvas(Chart.WIDTH, 3.4), results[0].run
    distances = [np.linalg.norm(load_difference(result.run, first), axis=1) for result in results[1:]]
    apart = max((np.nanmax(distance, initial=0.0) for distance in distances), default=0.0) > MIN_DEVIATION
    axes.set_autoscaley_on(apart)  # without a distance there is nothing to scale by
    for k, (result, apart_by) in enumerate(zip(results[1:], distances, strict=True)):
        away = 1e3 * apart_by.clip(min=0.1 * MIN_DEVIATION)
        style, colour = (
            STYLES[k // len(Chart.SERIES) % 3],
            Chart.STAND_IN[Chart.SERIES[k % len(Chart.SERIES)]],
        )
        axes.semilogy(first.time[: len(away)], away, style, color=colour, label=result.level.name)
    axes.set(xlabel="time [s]", ylabel="distance [mm]", ylim=(1e3 * MIN_DEVIATION, None if apart else 1.0))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.margins(x=0.0)
    drawing.legend(loc="outside upper center", ncols=4)
    return drawing


def certificate_figure(certificate: Certificate, loops: Loops) -> Drawing:
    """Draw the map on the left, the worst point with its `loops` on the right."""
    figure, (left, right) = Chart.canvas(10.0, 4.4, 1, 2)
    delay = f"delay {1e3 * certificate.delay:g} ms"
    figure.suptitle(f"{certificate.controller}, {certificate.drive} drives, {delay}")
    _draw_map(left, certificate)
    _draw_frequency(right, loops)
    right.set_title(f"worst: {certificate.worst.point}", fontsize=9)
    for axes in (left, right):
        axes.set_ylim(0.0, 1.02)
        axes.grid(visible=True, linewidth=0.4)
        axes.legend(frameon=False, fontsize=7.5, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3)
    return figure


def _draw_map(axes: Axes, certificate: Certificate) -> None:
    tilts = enumerate(dict.fromkeys(verdict.point.tilt for verdict in certificate.points))
    speeds = [*enumerate(dict.fromkeys(verdict.point.hoisting_speed for verdict in certificate.points))]
    for (i, tilt), (j, speed) in product(tilts, speeds):
        line = [v for v in certificate.points if (v.point.tilt, v.point.hoisting_speed) == (tilt, speed)]
        lengths, gaps = [v.point.rope_length for v in line], [v.gap for v in line]
        colour = Palette.LIGHT[Chart.SERIES[i % len(Chart.SERIES)]]
        label = f"{tilt[0]:g}, {tilt[1]:g} rad/s²; {speed:+g} m/s"
        axes.plot(lengths, gaps, STYLES[j % len(STYLES)], color=colour, linewidth=1.0, label=label)
        for length, gap, verdict in zip(lengths, gaps, line, strict=True):
            axes.plot(length, gap, MARKS[verdict.grade], color=colour, markersize=4)
    margins = {verdict.point.rope_length: verdict.margin for verdict in certificate.points}
    label = f"margin b = {certificate.margin:.3f}"
    axes.plot(*zip(*sorted(margins.items()), strict=True), "-_", color=Palette.LIGHT["limit"], label=label)
    axes.set(title="ν-gap; ○ certified, □ by frequency, × refused", xlabel="rope length [m]", ylabel="ν-gap")


def _draw_frequency(axes: Axes, loops: Loops) -> None:
    nominal, worst = loops
    omega = np.geomspace(MIN_FREQUENCY, np.pi / nominal.period, 600)
    z = np.exp(1j * omega * nominal.period)
    run, model = orthonormal(nominal.opening.graph(worst).response(z)), orthonormal(nominal.graph.response(z))
    colour = Palette.LIGHT[Chart.SERIES[0]]
    axes.semilogx(omega, distance(run, model), color=colour, label="distance to the design model")
    margin = smallest_sine(complement(nominal.opening.controller(z)), model)
    axes.semilogx(omega, margin, color=Palette.LIGHT["limit"], label="margin of the loop")
    axes.set(xlabel="angular frequency [rad/s]", ylabel="sine of the angle")
