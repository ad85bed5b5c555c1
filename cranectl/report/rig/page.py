"""Everything about one rig on one page: advice, certificate, fidelity ladder, error budget."""

from collections.abc import Sequence

from cranectl.analysis.advice import Advice, Assessment
from cranectl.analysis.budget.error_budget import Budget
from cranectl.analysis.certificate.certify import NominalLoop
from cranectl.analysis.certificate.loop import InnerLoop
from cranectl.analysis.ladder import Step
from cranectl.report.page import Figure, Page, Section
from cranectl.report.rig.advice_tables import controllers_table, improvements_table, recommendation
from cranectl.report.rig.budget_table import budget_table
from cranectl.report.rig.certificate_figure import certificate_figure
from cranectl.report.rig.certificate_tables import certificates_table
from cranectl.report.rig.deviation_bars import deviation_bars
from cranectl.report.rig.ladder_page import ladder_sections
from cranectl.report.theme import STAND_IN, inline_svg, styled


def rig_page(
    advice: Advice,
    nominal_loop: NominalLoop,
    worst: InnerLoop,
    steps: Sequence[Step],
    budget: Budget,
    remade_by: str,
) -> Page:
    """The page of a rig for which there is a recommendation; the two loops are its controller's."""
    best = advice.best
    assert best is not None
    tables = (controllers_table(advice), improvements_table(advice))
    sections = (
        Section("advice", "Which controller", recommendation(advice), tables),
        Section(
            "certificate",
            "Certificate",
            (
                "A nu-gap below the margin guarantees that the linear loop, frozen at that point, is stable. "
                "It says nothing of the motion from point to point; refused does not mean unstable.",
            ),
            (certificates_table(advice.assessments),),
            (_certificate(best, nominal_loop, worst),),
        ),
        *ladder_sections(steps, first=2),
        Section("budget", "Error budget", (), (budget_table(budget),), (_budget_figure(budget),)),
    )
    title = f"{advice.scenario.name}: the rig and its controllers"
    return Page(title, advice.scenario.title, sections, remade_by)


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
    svg = deviation_bars([entry.rung for entry in entries], pair, "f4", bounds=bounds)
    rough = [entry.rung for entry in entries if entry.rough]
    sentence = f"Estimates without a bound, which may be far off: {', '.join(rough)}." if rough else ""
    return Figure("4", "predicted, measured, bounded", svg, sentence)
