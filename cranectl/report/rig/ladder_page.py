"""A climb of the fidelity ladder as one page: what each effect costs, alone and on top of the others."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure as Drawing

from cranectl.analysis.deviation import load_difference
from cranectl.analysis.ladder import Step
from cranectl.analysis.levels import BASE
from cranectl.report.page import Figure, Page, Section
from cranectl.report.rig.deviation_bars import LEAST, WIDTH, deviation_bars
from cranectl.report.rig.ladder_table import ladder_table
from cranectl.report.table import Table, cells
from cranectl.report.theme import SERIES, STAND_IN, inline_svg, styled
from cranectl.scenario import Scenario


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
        Section("costs", "What each effect costs", tables=(ladder_table(steps),), figures=figures),
        Section("rungs", "The rungs", tables=(_rungs(steps),)),
    )


def _rungs(steps: Sequence[Step]) -> Table:
    rows = tuple(
        cells(
            step.rung.name,
            step.rung.adds,
            f"{step.rung.plant}, {step.rung.drive} drives",
            _settings(step),
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
    shown = [step for step in steps if step.cumulative]
    pair = {
        "on top of the rungs before": [step.cumulative.max if step.cumulative else 0.0 for step in shown],
        f"alone, on {BASE}": [step.alone.max if step.alone else 0.0 for step in shown],
    }
    return deviation_bars([step.rung.name for step in shown], pair, name)


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
