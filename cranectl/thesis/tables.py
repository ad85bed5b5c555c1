"""The tables of the thesis beside ours, for the terminal and for the page."""

from cranectl.report.table import Cell, Table, cells
from cranectl.thesis.reproduction import (
    FEEDBACK,
    SOURCES,
    SYMBOLS,
    Number,
    Reproduction,
    ThesisTable,
    controller_name,
)

SOURCE_NAMES = {"analytic": "analytic", "mujoco": "MuJoCo", "mujoco_velocity": "velocity\ndrives"}


def gain_table(reproduction: Reproduction) -> Table:
    """Gains of both feedbacks."""
    rows = tuple(
        cells(FEEDBACK[name], *(f"{gain:.5g}" for gain in gains))
        for name, gains in reproduction.gains.items()
    )
    headings = ("feedback", "k₀ [1/s⁴]", "k₁ [1/s³]", "k₂ [1/s²]", "k₃ [1/s]")
    return Table("State feedback gains, one axis", headings, rows, note="Not printed in the thesis.")


def robustifier_table(reproduction: Reproduction) -> Table:
    """What each robustifier does to a lasting error, and how much of it goes through its fastest mode."""
    rows = []
    for name, design in reproduction.designs.items():
        if design.gamma_achieved is not None:
            pole, gain = design.robustifier.fastest_mode
            left = design.gain[0] / (design.gain[0] + design.robustifier.static_gain)
            numbers = (_text(design.gamma_achieved), _text(left), _text(pole, ".4g"), _text(gain, ".4g"))
            rows.append(cells(controller_name(name), *numbers))
    return Table(
        "Robustifiers, one axis",
        ("controller", "γ achieved", "S(0)", "fastest pole [1/s]", "gain through it [1/s⁴]"),
        tuple(rows),
        note="S(0) is what remains of a steady error: nothing with an integrator, γ A with S/KS. S/KS leads "
        "nearly all of its output through a stiff mode, which is why the thesis's solver made it look noisy.",
    )


def printed_tables(reproduction: Reproduction) -> dict[str, Table]:
    """The thesis's tables by their number, printed beside ours, a line a number; its norms are "norms"."""
    return {name: _comparison(table) for name, table in reproduction.tables.items()}


def _comparison(table: ThesisTable) -> Table:
    rows = tuple(
        cells(controller_name(controller) if k == 0 else "", SYMBOLS[column], *_numbers(number))
        for controller, numbers in table.rows.items()
        for k, (column, number) in enumerate(numbers.items())
    )
    headings = ("controller", "", "printed", *SOURCE_NAMES.values(), "difference", "tolerance")
    unexplained = any(not number.explained for row in table.rows.values() for number in row.values())
    note = "Differences marked ? have a tolerance that nobody can explain yet." if unexplained else ""
    return Table(table.title, headings, rows, labels=2, note=note)


def _numbers(number: Number) -> list[str | Cell]:
    ours = [_text(number.ours[source]) if source in number.ours else "–" for source in SOURCES]
    mark = "bad" if not number.within else "good" if number.explained else "open"
    difference = _text(number.difference, "+.4f") + ("" if number.explained else " ?")
    return [_text(number.printed), *ours, Cell(difference, mark), _text(number.tolerance)]


def _text(value: float, form: str = ".4f") -> str:
    return f"{value:{form}}".replace("-", "−")
