"""Tables of reports on the terminal."""

from rich.console import Console

from cranectl.cli.screen_table import screen_table
from cranectl.report.table import Cell, Table

TABLE = Table(
    "Error [mm]",
    ("rung", "estimate\nRMS", "estimate\nmax", "measured\nRMS", "bound [mm]"),
    ((Cell("sampled"), Cell("1"), Cell("2"), Cell("3"), Cell("[4]", "bad")), (Cell("all"), *(Cell(""),) * 4)),
    note="effects.wind.mean = [0, 0]",
)


def lines(*, colours: bool = False) -> list[str]:
    screen = Console(width=80, color_system="standard" if colours else None, force_terminal=colours)
    with screen.capture() as capture:
        screen.print(screen_table(TABLE))
    return [line.rstrip() for line in capture.get().splitlines() if line.strip()]


def test_texts_with_brackets_are_shown_as_they_are() -> None:
    shown = "\n".join(lines())
    for text in ("Error [mm]", "bound [mm]", "[4]", "effects.wind.mean = [0, 0]"):
        assert text in shown


def test_what_neighbouring_headings_begin_with_is_said_once() -> None:
    title, first, second, *_ = lines()
    assert title == "Error [mm]"
    assert first.split() == ["estimate", "measured"]
    assert second.split() == ["rung", "RMS", "max", "RMS", "bound", "[mm]"]


def test_numbers_are_on_the_right_of_their_columns() -> None:
    (row,) = (line for line in lines() if line.strip().startswith("sampled"))
    (heading,) = (line for line in lines() if "RMS" in line)
    assert row.index("1") == heading.index("RMS") + 2


def test_marks_have_colours() -> None:
    red = "\x1b[1;31m"
    assert [red in line for line in lines(colours=True) if "sampled" in line] == [True]
    assert not any(red in line for line in lines(colours=True) if "all" in line)
