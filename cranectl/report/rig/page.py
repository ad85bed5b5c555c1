"""The pages of a rig: the fidelity ladder alone, or advice, certificate, ladder and error budget."""

from collections.abc import Sequence

from cranectl.analysis.advice import Advice, Assessment
from cranectl.analysis.budget.error_budget import Budget
from cranectl.analysis.certificate.certify import NominalLoop
from cranectl.analysis.certificate.loop import InnerLoop
from cranectl.analysis.ladder import LevelResult
from cranectl.analysis.levels import BASE
from cranectl.report.page import Figure, Page, Section
from cranectl.report.rig.figures import certificate_figure, deviation_bars, level_distances
from cranectl.report.rig.tables import (
    budget_table,
    certificates_table,
    controllers_table,
    improvements_table,
    ladder_table,
    levels_table,
    recommendation,
)
from cranectl.report.theme import STAND_IN, inline_svg, styled
from cranectl.scenario import Scenario

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
    certificate = _certificate(best, nominal_loop, worst)
    sections = (
        Section("advice", "Which controller", recommendation(advice), tables),
        Section(
            "certificate", "Certificate", (FROZEN,), (certificates_table(advice.assessments),), (certificate,)
        ),
        *_ladder_sections(results, first=2),
        Section("budget", "Error budget", (), (budget_table(budget),), (_budget_figure(budget),)),
    )
    title = f"{advice.scenario.name}: the rig and its controllers"
    return Page(title, advice.scenario.title, sections, remade_by)


def _ladder_sections(results: Sequence[LevelResult], *, first: int = 1) -> tuple[Section, ...]:
    """`first` is the number of their first figure."""
    shown = [result for result in results if result.cumulative]
    pair = {
        "on top of the levels before": [each.cumulative.max if each.cumulative else 0.0 for each in shown],
        f"alone, on {BASE}": [each.alone.max if each.alone else 0.0 for each in shown],
    }
    bars = deviation_bars([each.level.name for each in shown], pair, f"f{first}")
    largest = ""
    if shown:
        most, name = max((each.cumulative.max, each.level.name) for each in shown if each.cumulative)
        largest = f"The largest step is {name}: the load moves by up to {1e3 * most:.3g} mm."
    distances = level_distances(results, f"f{first + 1}")
    figures = (
        Figure(str(first), "what each level adds", bars, largest),
        Figure(str(first + 1), f"distance of the load from that of {results[0].level.name}", distances, ""),
    )
    return (
        Section("costs", "What each effect costs", tables=(ladder_table(results),), figures=figures),
        Section("levels", "The levels", tables=(levels_table(results),)),
    )


def _certificate(best: Assessment, nominal_loop: NominalLoop, worst: InnerLoop) -> Figure:
    with styled():
        drawing = certificate_figure(best.certificate, nominal_loop, worst, colours=STAND_IN)
        svg = inline_svg(drawing, "f1")
    return Figure("1", f"certificate of {best.controller}", svg, "", alone=True)


def _budget_figure(budget: Budget) -> Figure:
    entries = budget.entries
    pair = {
        "estimated": [entry.estimate.max for entry in entries],
        "measured": [entry.measured.max for entry in entries],
    }
    bounds = [entry.bound for entry in entries]
    svg = deviation_bars([entry.level for entry in entries], pair, "f4", bounds=bounds)
    rough = [entry.level for entry in entries if entry.rough]
    sentence = f"Estimates without a bound, which may be far off: {', '.join(rough)}." if rough else ""
    return Figure("4", "predicted, measured, bounded", svg, sentence)
