"""The pages of a rig: the fidelity ladder alone, or advice, certificate, ladder and error budget."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from cranectl.analysis.advice import Advice
from cranectl.analysis.budget.error_budget import Budget
from cranectl.analysis.certificate.certify import Certificate, NominalLoop
from cranectl.analysis.certificate.loop import InnerLoop
from cranectl.analysis.certificate.nu_gap import complement, distance, orthonormal, sines
from cranectl.analysis.ladder import LevelResult, load_difference
from cranectl.analysis.levels import BASE
from cranectl.report.page import Figure, Page, Section
from cranectl.report.rig.tables import (
    budget_table,
    certificates_table,
    controllers_table,
    improvements_table,
    ladder_table,
    levels_table,
    recommendation,
)
from cranectl.report.theme import SERIES, STAND_IN, spaced
from cranectl.scenario import Scenario
from cranectl.support.colours import LIGHT

WIDTH = 6.4  # [in]
LEAST = 1e-6  # [m] that is drawn
EDGE = "At the left edge: 1 µm or less."
LOWEST = 1e-2  # [rad/s]
STYLES = ("-", "--", ":", "-.")
MARKS = {"gap": "o", "by frequency": "s", "refused": "x"}
FROZEN = (
    "A nu-gap below the margin guarantees that the linear loop, frozen at that point, is stable. "
    "It says nothing of the motion from point to point; refused does not mean unstable."
)


def ladder_page(scenario: Scenario, controller: str, results: Sequence[LevelResult], remade_by: str) -> Page:
    """What each effect costs with one controller, alone and on top of the others."""
    title = f"{scenario.name}, {controller}: the fidelity ladder"
    return Page(title, scenario.title, _ladder_sections(results), remade_by)


def rig_page(
    advice: Advice,
    nominal_loop: NominalLoop,
    worst: InnerLoop,
    results: Sequence[LevelResult],
    budget: Budget,
    remade_by: str,
) -> Page:
    """The page of a rig for which there is a recommendation; the two loops are its controller's."""
    best = advice.best
    assert best is not None
    tables = (controllers_table(advice), improvements_table(advice))
    title = f"certificate of {best.controller}"
    loops = (best.certificate, nominal_loop, worst, STAND_IN)
    certificate = Figure.drawn(title, "", certificate_figure, *loops, alone=True)
    sections = (
        Section("advice", "Which controller", recommendation(advice), tables),
        Section(
            "certificate", "Certificate", (FROZEN,), (certificates_table(advice.assessments),), (certificate,)
        ),
        *_ladder_sections(results),
        Section("budget", "Error budget", (), (budget_table(budget),), (_budget_figure(budget),)),
    )
    title = f"{advice.scenario.name}: the rig and its controllers"
    return Page(title, advice.scenario.title, sections, remade_by)


def _ladder_sections(results: Sequence[LevelResult]) -> tuple[Section, ...]:
    shown = [result for result in results if result.cumulative]
    pair = {
        "on top of the levels before": [each.cumulative.max if each.cumulative else 0.0 for each in shown],
        f"alone, on {BASE}": [each.alone.max if each.alone else np.nan for each in shown],
    }
    names = [each.level.name for each in shown]
    largest = ""
    if shown:
        most, name = max((each.cumulative.max, each.level.name) for each in shown if each.cumulative)
        largest = f"The largest step is {name}: the load moves by up to {1e3 * most:.3g} mm. {EDGE}"
    distance = f"distance of the load from that of {results[0].level.name}"
    figures = (
        Figure.drawn("what each level adds", largest, deviation_dots, names, pair),
        Figure.drawn(distance, "", level_distances, results),
    )
    return (
        Section("costs", "What each effect costs", tables=(ladder_table(results),), figures=figures),
        Section("levels", "The levels", tables=(levels_table(results),)),
    )


def _budget_figure(budget: Budget) -> Figure:
    entries = budget.entries
    pair = {
        "estimated": [entry.estimate.max for entry in entries],
        "measured": [entry.measured.max for entry in entries],
    }
    names, bounds = [entry.level for entry in entries], [entry.bound for entry in entries]
    rough = [entry.level for entry in entries if entry.rough]
    sentence = f"Estimates without a bound, which may be far off: {', '.join(rough)}. " if rough else ""
    return Figure.drawn("predicted, measured, bounded", sentence + EDGE, deviation_dots, names, pair, bounds)


def deviation_dots(
    names: Sequence[str], pair: Mapping[str, Sequence[float]], bounds: Sequence[float] = ()
) -> Drawing:
    """Two dots a name, from label to values [m], those below LEAST at the edge; a mark for a finite bound."""
    drawing = Drawing(figsize=(WIDTH, 0.9 + 0.3 * len(names)), layout="constrained")
    axes, place = drawing.subplots(), np.arange(len(names))
    for offset, role, marker, (label, values) in zip((-0.1, 0.1), SERIES, "oD", pair.items(), strict=False):
        style: dict[str, Any] = {"color": STAND_IN[role], "markersize": 5, "clip_on": False, "zorder": 3}
        axes.plot(1e3 * np.maximum(values, LEAST), place + offset, marker, label=label, **style)
    bounded = [(1e3 * bound, k) for k, bound in enumerate(bounds) if 0.0 < bound < np.inf]
    if bounded:
        axes.plot(*zip(*bounded, strict=True), "|", color=STAND_IN["limit"], markersize=14, label="bound")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set(xlim=(1e3 * LEAST, None), xlabel="largest deviation of the load [mm]")
    axes.set_yticks(place, names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    drawing.legend(loc="outside upper center", ncols=3, columnspacing=spaced(axes.lines))
    return drawing


def level_distances(results: Sequence[LevelResult]) -> Drawing:
    """Distance of each load from the first one's over time, solid, then dashed."""
    drawing = Drawing(figsize=(WIDTH, 3.4), layout="constrained")
    axes, first = drawing.subplots(), results[0].run
    for k, result in enumerate(results[1:]):
        away = 1e3 * np.linalg.norm(load_difference(result.run, first), axis=1).clip(min=0.1 * LEAST)
        style, colour = STYLES[k // len(SERIES) % 3], STAND_IN[SERIES[k % len(SERIES)]]
        axes.semilogy(first.time[: len(away)], away, style, color=colour, label=result.level.name)
    axes.set(xlabel="time [s]", ylabel="distance [mm]", ylim=(1e3 * LEAST, None))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.margins(x=0.0)
    drawing.legend(loc="outside upper center", ncols=4)
    return drawing


def certificate_figure(
    certificate: Certificate,
    nominal_loop: NominalLoop,
    worst: InnerLoop,
    colours: Mapping[str, str] = LIGHT,
) -> Drawing:
    """The map on the left, on the right the worst point, where the loop is `worst`; `colours` by role."""
    figure = Drawing(figsize=(10.0, 4.4), layout="constrained")
    figure.suptitle(
        f"{certificate.controller}, {certificate.drive} drives, delay {1e3 * certificate.delay:g} ms"
    )
    left, right = figure.subplots(1, 2)
    _draw_map(left, certificate, colours)
    _draw_frequency(right, certificate, nominal_loop, worst, colours)
    return figure


def _draw_map(axes: Axes, certificate: Certificate, colours: Mapping[str, str]) -> None:
    tilts = list(dict.fromkeys(verdict.point.tilt for verdict in certificate.points))
    speeds = list(dict.fromkeys(verdict.point.hoisting_speed for verdict in certificate.points))
    for i, tilt in enumerate(tilts):
        for j, speed in enumerate(speeds):
            line = [v for v in certificate.points if (v.point.tilt, v.point.hoisting_speed) == (tilt, speed)]
            lengths, gaps = [v.point.rope_length for v in line], [v.gap for v in line]
            colour = colours[SERIES[i % len(SERIES)]]
            label = f"{tilt[0]:g}, {tilt[1]:g} rad/s²; {speed:+g} m/s"
            axes.plot(lengths, gaps, STYLES[j % len(STYLES)], color=colour, linewidth=1.0, label=label)
            for verdict in line:
                axes.plot(
                    verdict.point.rope_length, verdict.gap, MARKS[verdict.grade], color=colour, markersize=4
                )
    margins = {verdict.point.rope_length: verdict.margin for verdict in certificate.points}
    label = f"margin b = {certificate.margin:.3f}"
    axes.plot(*zip(*sorted(margins.items()), strict=True), "-_", color=colours["limit"], label=label)
    axes.set(title="ν-gap; ○ certified, □ by frequency, × refused", xlabel="rope length [m]", ylabel="ν-gap")
    _finish(axes)


def _draw_frequency(
    axes: Axes,
    certificate: Certificate,
    nominal_loop: NominalLoop,
    worst: InnerLoop,
    colours: Mapping[str, str],
) -> None:
    omega = np.geomspace(LOWEST, np.pi / nominal_loop.period, 600)
    z = np.exp(1j * omega * nominal_loop.period)
    run = orthonormal(nominal_loop.opening.graph(worst).response(z))
    model = orthonormal(nominal_loop.graph.response(z))
    axes.semilogx(omega, distance(run, model), color=colours[SERIES[0]], label="distance to the design model")
    margin = sines(complement(nominal_loop.opening.controller(z)), model)
    axes.semilogx(omega, margin, color=colours["limit"], label="margin of the loop")
    axes.set(
        title=f"worst: {certificate.worst.point}",
        xlabel="angular frequency [rad/s]",
        ylabel="sine of the angle",
    )
    axes.title.set_fontsize(9)
    _finish(axes)


def _finish(axes: Axes) -> None:
    axes.set_ylim(0.0, 1.02)
    axes.grid(visible=True, linewidth=0.4)
    axes.legend(frameon=False, fontsize=7.5)
