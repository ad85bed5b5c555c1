"""A climb of the fidelity ladder as one page: what each effect costs, alone and on top of the others."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure as Drawing

from cranectl.analysis.deviation import Size, load_difference
from cranectl.analysis.ladder import Step
from cranectl.analysis.rungs import BASE
from cranectl.report.page import Cell, Figure, Page, Section, Table
from cranectl.report.theme import SERIES, STAND_IN, inline_svg, styled
from cranectl.scenario import Scenario

WIDTH = 6.4  # [in]
LEAST = 1e-9  # [m] that is drawn


def ladder_page(scenario: Scenario, controller: str, steps: Sequence[Step], remade_by: str) -> Page:
    """The page of a climb with one controller."""
    title = f"{scenario.name}, {controller}: the fidelity ladder"
    return Page(title, scenario.title, ladder_sections(steps), remade_by)


def ladder_sections(steps: Sequence[Step], *, first: int = 1) -> tuple[Section, ...]:
    """The sections of a climb; `first` is the number of their first figure."""
    bars, distances = str(first), str(first + 1)
    apart = f"distance of the load from that of {steps[0].rung.name}"
    figures = (
        Figure(bars, "what each rung adds", _bars(steps, f"f{bars}"), _largest(steps)),
        Figure(distances, apart, _distances(steps, f"f{distances}"), ""),
    )
    return (
        Section("costs", "What each effect costs", tables=(_table(steps),), figures=figures),
        Section("rungs", "The rungs", tables=(_rungs(steps),)),
    )


def _table(steps: Sequence[Step]) -> Table:
    headings = ("rung", "ended", "RMS error [mm]", "max error [mm]", "final error [mm]", "adds RMS [mm]",
                "adds max [mm]", "adds final [mm]", "alone RMS [mm]", "alone max [mm]", "alone final [mm]",
                "effort [m/s²]", "sway [°]")  # fmt: skip
    note = (
        f"Adds: distance of the load from where it was on the rung before. Alone: from {BASE}, with this "
        "effect only. Effort: RMS of the commanded accelerations. Sway: RMS angle between rope and plumb "
        "line."
    )
    return Table(
        "Tracking error and deviations", headings, tuple(_row(step) for step in steps), labels=2, note=note
    )


def _row(step: Step) -> tuple[Cell, ...]:
    status = step.run.status
    ended = Cell(status.label, "bad" if status.stopped else "good")
    metrics = step.metrics
    if metrics is None:
        return (Cell(step.rung.name), ended, *(Cell("–"),) * 11)
    errors = Size(metrics.rms_error_m, metrics.max_error_m, metrics.final_error_m)
    return (
        Cell(step.rung.name),
        ended,
        *_cells(errors),
        *_cells(step.cumulative),
        *_cells(step.alone),
        Cell(f"{math.hypot(*metrics.rms_acceleration_m_s2):.4f}"),
        Cell(f"{math.degrees(metrics.rms_sway_rad):.3f}"),
    )


def _cells(found: Size | None) -> tuple[Cell, ...]:
    if found is None:
        return (Cell(""),) * 3
    return tuple(Cell(f"{1e3 * value:.3g}") for value in (found.rms, found.max, found.final))


def _rungs(steps: Sequence[Step]) -> Table:
    rows = tuple(
        (
            Cell(step.rung.name),
            Cell(step.rung.adds),
            Cell(f"{step.rung.plant}, {step.rung.drive} drives"),
            Cell(_settings(step)),
        )
        for step in steps
    )
    return Table("What is added", ("rung", "adds", "plant", "settings"), rows, labels=4)


def _settings(step: Step) -> str:
    """The numbers of the effect that a rung adds."""
    effect = getattr(step.run.scenario.effects, step.rung.name, None)
    if effect is None:
        return ""
    return ", ".join(f"{name} = {value}" for name, value in effect.model_dump(mode="json").items())


def _largest(steps: Sequence[Step]) -> str:
    found = [(step.cumulative.max, step.rung.name) for step in steps if step.cumulative]
    if not found:
        return ""
    largest, name = max(found)
    return f"The largest step is {name}: the load moves by up to {1e3 * largest:.3g} mm."


def _bars(steps: Sequence[Step], name: str) -> str:
    """Largest deviations on a logarithmic axis, a row a rung."""
    shown = [step for step in steps if step.cumulative]
    with styled():
        drawing = Drawing(figsize=(WIDTH, 0.9 + 0.28 * len(shown)), layout="constrained")
        axes = drawing.subplots()
        place = np.arange(len(shown))
        for offset, role, label, values in (
            (-0.2, SERIES[0], "on top of the rungs before", [step.cumulative for step in shown]),
            (0.2, SERIES[1], f"alone, on {BASE}", [step.alone for step in shown]),
        ):
            lengths = [max(value.max, LEAST) if value else LEAST for value in values]
            axes.barh(place + offset, lengths, height=0.36, color=STAND_IN[role], label=label, left=0.0)
        axes.set_xscale("log")
        axes.set(xlim=(LEAST, None), xlabel="largest deviation of the load [m]")
        axes.set_yticks(place, [step.rung.name for step in shown])
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        drawing.legend(loc="outside upper center", ncols=2)
        return inline_svg(drawing, name)


def _distances(steps: Sequence[Step], name: str) -> str:
    """Over time, all rungs: solid for the first colours, then dashed and dotted."""
    with styled():
        drawing = Drawing(figsize=(WIDTH, 3.4), layout="constrained")
        axes = drawing.subplots()
        first = steps[0].run
        for k, step in enumerate(steps[1:]):
            apart = np.linalg.norm(load_difference(step.run, first), axis=1)
            style = ("-", "--", ":")[k // len(SERIES) % 3]
            colour = STAND_IN[SERIES[k % len(SERIES)]]
            axes.semilogy(
                first.time[: len(apart)], apart.clip(min=LEAST), style, color=colour, label=step.rung.name
            )
        axes.set(xlabel="time [s]", ylabel="distance [m]", ylim=(LEAST, None))
        axes.margins(x=0.0)
        drawing.legend(loc="outside upper center", ncols=6)
        return inline_svg(drawing, name)
