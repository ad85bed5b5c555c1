"""Tables of reports on the terminal."""

import io

from rich.console import Console

from cranectl.cli.screen import Screen, screen_table
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


def test_texts_fold_where_there_is_no_room_but_never_the_first_column() -> None:
    words = "what a scenario is for, in some words"
    table = Table(
        "", ("name", "what it is", "[m]"), ((Cell("settled-trajectory"), Cell(words), Cell("1.5")),), 2
    )
    on = Screen(stderr=False)
    on.file, on.width = io.StringIO(), 40
    on.print(table)
    shown = on.file.getvalue()
    assert "settled-trajectory" in shown
    assert "1.5" in shown
    assert words not in shown
    below = shown.rpartition("─")[2].split()
    assert [word for word in below if word in words.split()] == words.split()


def test_a_table_without_headings_has_no_line_for_them() -> None:
    screen = Console(width=80)
    with screen.capture() as capture:
        screen.print(screen_table(Table("title", ("", ""), ((Cell("gain"), Cell("2")),))))
    assert [line.split() for line in capture.get().splitlines() if line.strip()] == [["title"], ["gain", "2"]]


def test_what_stands_over_rows_is_bold() -> None:
    screen = Console(width=80, color_system="standard", force_terminal=True)
    with screen.capture() as capture:
        screen.print(screen_table(Table("", ("a", "b"), ((Cell("over", "head"), Cell("")),))))
    assert "\x1b[1mover" in capture.get()
