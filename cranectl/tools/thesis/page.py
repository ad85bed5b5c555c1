"""A page with the thesis's tables, printed and computed, and its figures, numbered as in the thesis.

`validation/thesis/drawing/draw.py` draws the diagrams of model, controllers and simulation with correct signs
and our symbols, in the page's text colour. A page may set the CSS variables --block (fill of blocks, none by
default) and --forbidden (fill of the bounds in 4.6, by default as blocks).
"""

from collections.abc import Iterable

import numpy as np
from matplotlib.figure import Figure as Drawing

from cranectl.planning import load_scenario
from cranectl.reference import TimeLaw
from cranectl.report import Cell, Chart, DesignReport, Family, Figure, LogPage, Page, RunCurve, Section, Table
from cranectl.simulate import Run
from cranectl.support import TOML, Shipped
from cranectl.tools.thesis.first_screen import thesis_screen
from cranectl.tools.thesis.reproduction import (
    FEEDBACK,
    ROBUSTIFIERS,
    SOURCES,
    SYMBOLS,
    Number,
    Reproduction,
    ThesisTable,
    controller_name,
)

# Number of a scenario's first figure, the load in space. Per family, one figure for each feedback follows.
FIRST_FIGURE = {"fixed-position": 10, "settled-trajectory": 29}
# Title and note of each diagram; the note includes misprints of the thesis.
DIAGRAMS: dict[str, dict[str, str]] = TOML.read(Shipped.THESIS_FOLDER / "diagrams.toml")
DIAGRAM_DIRECTORY = Shipped.THESIS_FOLDER / "diagrams"
SOURCE_NAMES = {"analytic": "analytic", "mujoco": "MuJoCo", "mujoco_velocity": "velocity\ndrives"}
# In the order of the thesis's figures, beside "space"; `Family.ALL` has more, without a figure there.
FAMILY_NAMES = (
    "error", "linear-input", "input", "trolley", "angles", "load",
    "trolley-path", "load-path", "relative-path",
)  # fmt: skip


class ChapterFigures:
    """Draws the figures of chapter 5 as runs finish, so that few runs are in memory at once."""

    def __init__(self) -> None:
        self.figures: dict[str, list[Figure]] = {name: [] for name in FIRST_FIGURE}
        self._runs: dict[tuple[str, str], Run] = {}  # (robustifier, source)

    def watch(self, source: str, run: Run) -> None:
        """Add a run, and draw its figures once all runs of its feedback are complete."""
        feedback, _, robustifier = run.design.name.partition("+")
        self._runs[robustifier, source] = run
        if len(self._runs) == len(ROBUSTIFIERS) * len(SOURCES):
            self.figures[run.scenario.name] += _feedback_figures(feedback, self._runs)
            self._runs = {}

    def of(self, scenario: str) -> tuple[Figure, ...]:
        """Return the figures of a scenario, sorted by number."""
        return tuple(sorted(self.figures[scenario], key=lambda figure: _figure_key(figure.number)))


def gain_table(reproduction: Reproduction) -> Table:
    """Return a table of the gains of both feedbacks."""
    named = reproduction.gains.items()
    rows = tuple(Cell.row(FEEDBACK[name], *(f"{gain:.5g}" for gain in gains)) for name, gains in named)
    headings = ("feedback", "k₀ [1/s⁴]", "k₁ [1/s³]", "k₂ [1/s²]", "k₃ [1/s]")
    return Table("State feedback gains, one axis", headings, rows, note="Not printed in the thesis.")


def robustifier_table(reproduction: Reproduction) -> Table:
    """Return a table of the remaining steady error and the fastest mode of each robustifier."""
    rows = []
    for name, design in reproduction.designs.items():
        if design.gamma_achieved is not None:
            offset = design.gain[0] / (design.gain[0] + design.robustifier.static_gain)
            mode = (_format(number, ".4g") for number in design.robustifier.fastest_mode)
            rows.append(
                Cell.row(controller_name(name), _format(design.gamma_achieved), _format(offset), *mode)
            )
    headings = ("controller", "γ achieved", "S(0)", "fastest pole [1/s]", "gain through it [1/s⁴]")
    note = (
        "S(0) is what remains of a steady error: nothing with an integrator, γ A with S/KS. S/KS leads "
        "nearly all of its output through a stiff mode, which is why the thesis's solver made it look noisy."
    )
    return Table("Robustifiers, one axis", headings, tuple(rows), note=note)


def printed_tables(reproduction: Reproduction) -> dict[str, Table]:
    """Return the thesis's tables by number, with printed and computed values."""
    return {name: _comparison(table) for name, table in reproduction.tables.items()}


def _comparison(table: ThesisTable) -> Table:
    rows = tuple(
        Cell.row(controller_name(controller) if k == 0 else "", SYMBOLS[column], *_numbers(number))
        for controller, numbers in table.rows.items()
        for k, (column, number) in enumerate(numbers.items())
    )
    headings = ("controller", "", "printed", *SOURCE_NAMES.values(), "difference", "tolerance")
    unexplained = any(not number.explained for row in table.rows.values() for number in row.values())
    note = "Differences marked ? have a tolerance without an explanation." if unexplained else ""
    return Table(table.title, headings, rows, labels=2, note=note)


def _numbers(number: Number) -> list[str | Cell]:
    computed = [_format(number.computed[source]) if source in number.computed else "–" for source in SOURCES]
    mark = "bad" if not number.is_within else "good" if number.explained else "open"
    difference = _format(number.difference, "+.4f") + ("" if number.explained else " ?")
    return [_format(number.printed), *computed, Cell(difference, mark), _format(number.tolerance)]


def _format(value: float, form: str = ".4f") -> str:
    return f"{value:{form}}".replace("-", "−")


def thesis_page(reproduction: Reproduction, figures: ChapterFigures, remade_by: str) -> Page:
    """Return the whole page."""
    tables = printed_tables(reproduction)
    redrawn = "The signal-flow pictures, redrawn for the corrected equations."
    circle = (
        "A line, then a full clockwise turn about the middle of the rig: the text does not print the circle, "
        "this reading of it comes closest to Table 5.3."
    )
    designs = (gain_table(reproduction), tables["norms"], robustifier_table(reproduction))
    held, settled = (figures.of(scenario) for scenario in FIRST_FIGURE)
    sections = (
        _summary(reproduction),
        Section("structure", "Model and control loop", (redrawn,), figures=_diagrams("2.1", "4.1")),
        Section("trajectory", "Trajectory generation", figures=(_time_law_figure(),)),
        Section("robustification", "Feedback and robustification", figures=_diagrams("4.2", "5.1")),
        Section("simulation", "The simulation", figures=_diagrams("5.1", "5.7")),
        Section("designs", "Designs", (), designs, tuple(_design_figures(reproduction))),
        Section("fixed-position", "Load held in a fixed position", (), (tables["5.1"], tables["5.2"]), held),
        Section(
            "settled-trajectory",
            "Load on the settled trajectory",
            (circle,),
            (tables["5.3"], tables["5.4"]),
            settled,
        ),
    )
    lead = (
        "Chapter 5 of J. L. Zárate Moya, Tracking Controller Design for a Nonlinear Model of a Gantry Crane "
        "(TU Ilmenau / PUCP, 2015), on two plants that know nothing of each other: the analytic model and "
        "MuJoCo."
    )
    first = thesis_screen(reproduction)
    return Page("The thesis, run again", lead, sections, remade_by, first)


def _summary(reproduction: Reproduction) -> Section:
    """Return the section that says what differs; what is known of unexplained differences is folded."""
    rows = tuple(Cell.row(", ".join(numbers), why) for why, numbers in reproduction.open_points.items())
    count = sum(not number.explained for *_, number in reproduction.numbers())
    title = f"What nobody can explain: {count} differences, of {len(rows)} kinds"
    table = Table(title, ("table and column", "what is known"), rows, labels=2, folded=True)
    sentences = tuple(f"{text[0].upper()}{text[1:]}." for text in reproduction.unnoticed)
    return Section("summary", "What differs", sentences, (table,))


def _feedback_figures(feedback: str, runs: dict[tuple[str, str], Run]) -> Iterable[Figure]:
    """Yield the figures of one scenario and one feedback, with all its robustifiers."""
    labels = dict(zip(ROBUSTIFIERS.items(), Chart.SERIES, strict=False))
    curves = [
        RunCurve(label, colour, runs[robustifier, plant], wide=plant == "analytic")
        for (robustifier, label), colour in labels.items()
        for plant in ("analytic", "mujoco")
    ]
    shown = {label: runs[robustifier, "mujoco"] for robustifier, label in ROBUSTIFIERS.items()}
    scenario = next(iter(shown.values())).scenario
    first, offset = FIRST_FIGURE[scenario.name], list(FEEDBACK).index(feedback)
    numbers = {name: first + 1 + 2 * k + offset for k, name in enumerate(FAMILY_NAMES)}
    if offset == 0:
        numbers["space"] = first
    ideal, velocity = (
        [(runs[r, "analytic"], runs[r, source]) for r in ROBUSTIFIERS]
        for source in ("mujoco", "mujoco_velocity")
    )
    for name, position in numbers.items():
        family = Family.ALL[name]
        difference = LogPage.agreement(family, ideal, "Analytic and MuJoCo curves differ by at most")
        with_lag = LogPage.agreement(family, velocity, "with velocity drives by")
        text = f"{LogPage.caption(family, shown)} {difference}, {with_lag}."
        title = f"{family.title}, {FEEDBACK[feedback]}"
        options = {"alone": name == "space", "number": f"5.{position}"}
        yield Figure.drawn(title, text, family.draw, family, curves, **options)


def _diagrams(first: str, end: str) -> tuple[Figure, ...]:
    """Return the signal-flow diagrams numbered from `first` to before `end`."""
    return tuple(
        Figure(texts["title"], diagram_svg(number), texts["note"], number=number)
        for number, texts in DIAGRAMS.items()
        if _figure_key(first) <= _figure_key(number) < _figure_key(end)
    )


def diagram_svg(number: str) -> str:
    """Return the diagram `number` as an <svg> element."""
    return (DIAGRAM_DIRECTORY / f"{number}.svg").read_text(encoding="utf-8").rstrip()


def _figure_key(number: str) -> tuple[int, ...]:
    """Return (chapter, figure), by which figures are sorted."""
    return tuple(int(part) for part in number.split("."))


def _time_law_figure() -> Figure:
    third = TimeLaw("degree-5").sample(np.array([0.0]))[3, 0]
    return Figure.drawn(
        "Trajectory generation",
        "Position, velocity and acceleration of the thesis's quintic (4.3) and of the degree 9 that z_d ∈ C⁴ "
        f"asks for. Both come to rest; the third derivative of the quintic jumps from 0 to {third:.0f}.",
        _draw_time_laws,
        number="4.1",
    )


def _draw_time_laws() -> Drawing:
    """Draw position, velocity, acceleration of both time laws."""
    tau = np.linspace(0.0, 1.0, 401)
    drawing, stack = Chart.canvas(Chart.WIDTH, 4.6, 3, 1, sharex=True)
    for name, style in (("degree-5", {"linewidth": 2.0}), ("degree-9", {"linestyle": (0, (5, 2))})):
        for axes, values in zip(stack, TimeLaw(name).sample(tau), strict=False):
            axes.plot(tau, values, label=name.replace("-", " "), **style)
    for axes, label in zip(stack, ("s [1]", "ds/dτ [1]", "d²s/dτ² [1]"), strict=True):
        axes.set_ylabel(label)
        axes.margins(x=0.0)
    stack[-1].set_xlabel("τ = t / t_f [1]")
    stack[0].legend()
    return drawing


def _design_figures(reproduction: Reproduction) -> Iterable[Figure]:
    """Yield 5.7 and 5.8: the loops that loop shaping makes of both feedbacks."""
    settings = load_scenario("fixed-position").design
    for number, (feedback, name) in zip(("5.7", "5.8"), FEEDBACK.items(), strict=True):
        design = reproduction.designs[f"{feedback}+loop-shaping"]
        margins = design.margins
        text = (
            f"γ = {design.gamma:.4f}, the coprime factors may err by ε = {design.stability_margin:.3f}; "
            f"cut at v, the loop gain may fall to {margins.gain_margin:.2f} of itself, the phase lag by "
            f"{np.degrees(margins.phase_margin):.0f}°; modulus margin {margins.modulus_margin:.2f}."
        )
        title = f"Singular values and shaped loop, {name} with loop shaping"
        yield Figure.drawn(title, text, DesignReport.loop_shaping_figure, design, settings, number=number)
