"""Output on a screen: text from outside cannot control the terminal, and narrow tables truncate no number."""

import io
import re

import pytest
from rich.console import Console
from rich.text import Text

from cranectl.cli.output import Screen, heading, screen_table, styled
from cranectl.report import table as report
from cranectl.support.errors import MAX_PHRASE, printable

HOSTILE = "e[red].mcap [/] \x1b[2J\x07 a\nforged: line\r \u202e\u2028 \udcff :smile:"


def screen(width: int = 80) -> Screen:
    result = Screen(stderr=False)
    result.file, result.width = io.StringIO(), width
    return result


def output(terminal: Screen) -> str:
    assert isinstance(terminal.file, io.StringIO)
    return terminal.file.getvalue()


@pytest.mark.parametrize("position", ["line", "style", "cell", "heading", "title"])
def test_text_from_outside_is_printed_as_one_harmless_line(position: str) -> None:
    terminal = screen(200)
    table = report.Table("t", ("h", "i"), ((report.Cell(HOSTILE, "bad"), report.Cell("1")),))
    if position == "line":
        terminal.print(HOSTILE)
    elif position == "style":
        terminal.print("before", styled(HOSTILE, "bold"))
    elif position == "cell":
        terminal.print(table)
    elif position == "heading":
        terminal.print(report.Table("t", (HOSTILE.replace("\n", " "), "i"), table.rows))
    else:
        terminal.print(report.Table(HOSTILE, ("h", "i"), table.rows))
    text = output(terminal)
    joined = "".join(line.strip() for line in text.split("\n"))  # a title is folded to the table's width
    for part in ("e[red].mcap[/]", ":smile:", r"\x1b[2J\x07", r"\udcff"):
        assert part in joined.replace(" ", "")
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e\u2028\ud800-\udfff]", text)
    assert "\nforged" not in text


def test_a_long_text_is_shortened() -> None:
    text = printable("a" * 10_000_000)
    assert len(text) < MAX_PHRASE + 50
    assert "9999500 characters" in text
    assert printable("short ẍ_c") == "short ẍ_c"


NUMBERS = [f"{k}.67e-0{k}" for k in range(9)]


@pytest.mark.parametrize("width", [200, 80, 40, 12])
def test_no_number_is_truncated(width: int) -> None:
    headings = ("what is measured", *(f"heading {k}\n[mm]" for k in range(9)))
    terminal = screen(width)
    terminal.print(report.Table("", headings, (report.cells("friction of the axes", *NUMBERS),)))
    text = output(terminal)
    assert all(number in text for number in NUMBERS)
    assert "…" not in text
    assert text.count("friction of the axes") == (1 if width == 200 else text.count("what is measured"))


def test_a_split_table_keeps_title_note_and_group_headings() -> None:
    """A group heading over several columns is repeated in each part that has some of them."""
    headings = ("rung", *(f"error [mm]\n{name}" for name in ("RMS", "max", "final")), "sway\n[°]")
    cells = tuple(report.Cell(text) for text in ("servos", "1.0", "2.0", "3.0", "4.0"))
    table = report.Table("what each rung adds", headings, (cells,), note="a note")
    terminal = screen(23)
    terminal.print(table)
    text = output(terminal)
    assert text.count("what each rung") == text.count("a note") == 1
    assert text.index("what each rung") < text.index("servos") < text.rindex("servos") < text.index("a note")
    assert text.count("servos") == 3
    assert text.count("error [mm]") == 2, "RMS and max; final; sway"
    wide = screen(200)
    wide.print(table)
    assert output(wide).count("error [mm]") == 1


def test_long_lines_are_not_wrapped() -> None:
    terminal = screen(23)
    terminal.print("log:", "a" * 50)
    assert output(terminal) == "log: " + "a" * 50 + "\n"


def test_headings_may_have_several_lines() -> None:
    assert heading("a\nb") == Text("a\nb")


def test_columns_are_narrowed_before_a_table_is_split() -> None:
    cells = (report.Cell("row"), *map(report.Cell, NUMBERS[:8]))
    table = report.Table("t", ("", *"abcdefgh"), (cells,))
    wide, narrow = screen(200), screen(80)
    for terminal in (wide, narrow):
        terminal.print(table)
        assert output(terminal).count("row") == 1
    widths = [len(max(output(terminal).splitlines(), key=len)) for terminal in (wide, narrow)]
    assert widths[0] > 80 >= widths[1]


TABLE = report.Table(
    "Error [mm]",
    ("rung", "estimate\nRMS", "estimate\nmax", "measured\nRMS", "bound [mm]"),
    (
        report.cells("sampled", "1", "2", "3", report.Cell("[4]", "bad")),
        report.cells(report.Cell("all", "head"), *[""] * 4),
    ),
    note="effects.wind.mean = [0, 0]",
)


def test_a_table_is_printed_with_group_headings_and_aligned_numbers() -> None:
    """Brackets are kept, a common start of headings is printed once, and numbers are aligned to the right."""
    terminal = screen()
    terminal.print(TABLE)
    title, first, second, _, row, *_, note = [
        line.rstrip() for line in output(terminal).splitlines() if line.strip()
    ]
    assert title == "Error [mm]"
    assert first.split() == ["estimate", "measured"]
    assert second.split() == ["rung", "RMS", "max", "RMS", "bound", "[mm]"]
    assert row.split() == ["sampled", "1", "2", "3", "[4]"]
    assert row.index("1") == second.index("RMS") + 2
    assert note.strip() == "effects.wind.mean = [0, 0]"
    terminal = screen()
    terminal.print(report.Table("title", ("", ""), (report.cells("gain", "2"),)))
    assert [line.split() for line in output(terminal).splitlines() if line.strip()] == [
        ["title"],
        ["gain", "2"],
    ]


def test_marked_cells_are_coloured() -> None:
    coloured = Console(width=80, color_system="standard", force_terminal=True)
    with coloured.capture() as capture:
        coloured.print(screen_table(TABLE))
    (sampled,) = (line for line in capture.get().splitlines() if "sampled" in line)
    assert re.search(r"\x1b\[1;31m *\[4\]", sampled)
    assert "\x1b[1mall" in capture.get()


def test_long_cells_are_folded_except_in_the_first_column() -> None:
    words = "what a scenario is for, in some words"
    terminal = screen(40)
    terminal.print(
        report.Table(
            "", ("name", "what it is", "[m]"), (report.cells("settled-trajectory", words, "1.5"),), 2
        )
    )
    text = output(terminal)
    assert "settled-trajectory" in text
    assert "1.5" in text
    assert words not in text
    assert [word for word in text.rpartition("─")[2].split() if word in words.split()] == words.split()
