"""The first screen of the thesis's page: each printed number of its tables beside the computed one."""

from collections.abc import Iterator, Mapping, Sequence

from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import MaxNLocator

from cranectl.report import Cell, Chart, Fact, Figure, FirstScreen
from cranectl.tools.thesis.reproduction import SYMBOLS, Number, Reproduction, ThesisTable, controller_name

# Kinds of numbers by the columns that have them, with the unit of their differences.
NORMS, ACCELERATIONS, POSITIONS = "H∞ norms", "largest accelerations", "positions of the load"


def thesis_screen(reproduction: Reproduction) -> FirstScreen:
    """Return the first screen, with a picture of the numbers of all tables."""
    tables = {name: table for name, table in reproduction.tables.items() if name != "norms"}
    picture = Figure.drawn(
        "what the tables print, and what two models of the crane give",
        "Rings: printed. Dots: computed with MuJoCo; with the analytic model they are at the same places.",
        _draw_tables,
        tables,
        alone=True,
    )
    numbers = [number for *_, number in reproduction.numbers()]
    explained, fitted = _counts(numbers)
    badge = f"{explained} OF {len(numbers)} REPRODUCED" + (f", {fitted} CLOSE" if fitted else "")
    return FirstScreen(
        Cell(badge, "bad" if not reproduction.passed else "open" if fitted else "good"),
        " ".join(_reason(numbers)),
        tuple(_facts(reproduction)),
        figures=(picture,),
    )


def _reason(numbers: Sequence[Number]) -> Iterator[str]:
    explained, fitted = _counts(numbers)
    yield (
        f"{explained} numbers of chapter 5 come out as printed, but for rounding and causes that are known "
        "and stated."
    )
    if fitted:
        yield f"{fitted} are close: how they differ, marked ? in the tables, nobody can explain yet."
    if outside := len(numbers) - explained - fitted:
        yield f"{outside} out of tolerance."


def _counts(numbers: Sequence[Number]) -> tuple[int, int]:
    """Return how many numbers are within tolerances that are explained, and within others."""
    within = [number.explained for number in numbers if number.is_within]
    return sum(within), len(within) - sum(within)


def _facts(reproduction: Reproduction) -> Iterator[Fact]:
    """Yield, for each kind of number, how many are within tolerance and the largest difference."""
    kinds: dict[str, list[Number]] = {}
    for _, _, column, number in reproduction.numbers():
        kind = POSITIONS if column.startswith("load_") else ACCELERATIONS
        kinds.setdefault(NORMS if column == "gamma" else kind, []).append(number)
    for kind, numbers in kinds.items():
        if kind == POSITIONS:
            largest = f"{1e3 * max(abs(number.difference) for number in numbers):.0f} mm"
        else:
            largest = f"{max(abs(number.difference / number.printed) for number in numbers):.1%}"
        within = sum(number.is_within for number in numbers)
        mark = "" if within == len(numbers) else "bad"
        yield Fact(kind, largest, f"largest difference; {within} of {len(numbers)} within tolerance", mark)


def _draw_tables(tables: Mapping[str, ThesisTable]) -> Drawing:
    """Draw a row of panels for each table, one panel for each column, and in it the controllers."""
    drawing = Drawing(figsize=(Chart.WIDTH, 1.75 * len(tables)), layout="constrained")
    parts = drawing.subfigures(len(tables), 1, squeeze=False)[:, 0]
    for part, (name, table) in zip(parts, tables.items(), strict=True):
        part.suptitle(f"Table {name}: {_subject(table)}", x=0.01, ha="left", fontsize=9)
        rows = list(table.rows.values())
        places = range(len(rows))
        panels = part.subplots(1, len(rows[0]), sharey=True)
        for axes, column in zip(panels, rows[0], strict=True):
            printed = [row[column].printed for row in rows]
            computed = [row[column].computed["mujoco"] for row in rows]
            axes.scatter(printed, places, s=38, facecolors="none", edgecolors=Chart.STAND_IN["ink"])
            axes.scatter(computed, places, s=9, color=Chart.STAND_IN["limit"])
            axes.margins(x=0.15, y=0.12)
            axes.xaxis.set_major_locator(MaxNLocator(2))
            unit = "m" if column.startswith("load_") else "m/s²"
            axes.set_xlabel(f"{SYMBOLS[column]} [{unit}]", labelpad=2.0)
        panels[0].set_yticks(places, [controller_name(controller) for controller in table.rows])
        panels[0].invert_yaxis()
    return drawing


def _subject(table: ThesisTable) -> str:
    return table.title.partition(": ")[2].partition(" [")[0].lower()
