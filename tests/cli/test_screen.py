"""Output on a screen: text from outside cannot control the terminal, and narrow tables truncate no number."""

import io
import re

import pytest
from rich.console import Console

from cranectl.cli.output import Screen, screen_table
from cranectl.report import table as report
from cranectl.support.errors import MAX_PHRASE, printable

HOSTILE = "e[red].mcap [/] \x1b[2J\x07 a\nforged: line\r \u202e\u2028 \udcff :smile:"


def output(*printed: object, width: int = 80) -> str:
    """Return what a screen of some width shows."""
    terminal, file = Screen(stderr=False), io.StringIO()
    terminal.file, terminal.width = file, width
    terminal.print(*printed)
    return file.getvalue()


@pytest.mark.parametrize("position", ["line", "style", "cell", "heading", "title"])
def test_text_from_outside_is_printed_as_one_harmless_line(position: str) -> None:
    rows = ((report.Cell(HOSTILE, "bad"), report.Cell("1")),)
    printed = {
        "line": [HOSTILE],
        "style": ["before", Screen.styled(HOSTILE, "bold")],
        "cell": [report.Table("t", ("h", "i"), rows)],
        "heading": [report.Table("t", (HOSTILE.replace("\n", " "), "i"), rows)],
        "title": [report.Table(HOSTILE, ("h", "i"), rows)],
    }
    text = output(*printed[position], width=200)
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
    table = report.Table("", headings, (report.Cell.row("friction of the axes", *NUMBERS),))
    text = output(table, width=width)
    assert all(number in text for number in NUMBERS)
    assert "…" not in text
    assert text.count("friction of the axes") == (1 if width == 200 else text.count("what is measured"))


def test_a_split_table_keeps_title_note_and_group_headings() -> None:
    """A group heading over several columns is repeated in each part that has some of them."""
    headings = ("rung", *(f"error [mm]\n{name}" for name in ("RMS", "max", "final")), "sway\n[°]")
    cells = tuple(report.Cell(text) for text in ("servos", "1.0", "2.0", "3.0", "4.0"))
    table = report.Table("what each rung adds", headings, (cells,), note="a note")
    text = output(table, width=23)
    assert text.count("what each rung") == text.count("a note") == 1
    assert text.index("what each rung") < text.index("servos") < text.rindex("servos") < text.index("a note")
    assert text.count("servos") == 3
    assert text.count("error [mm]") == 2, "RMS and max; final; sway"
    assert output(table, width=200).count("error [mm]") == 1


def test_long_lines_are_not_wrapped() -> None:
    assert output("log:", "a" * 50, width=23) == "log: " + "a" * 50 + "\n"


def test_columns_are_narrowed_before_a_table_is_split() -> None:
    cells = (report.Cell("row"), *map(report.Cell, NUMBERS[:8]))
    table = report.Table("t", ("", *"abcdefgh"), (cells,))
    wide, narrow = (output(table, width=width) for width in (200, 80))
    assert wide.count("row") == narrow.count("row") == 1
    assert max(map(len, wide.splitlines())) > 80 >= max(map(len, narrow.splitlines()))


TABLE = report.Table(
    "Error [mm]",
    ("rung", "estimate\nRMS", "estimate\nmax", "measured\nRMS", "bound [mm]"),
    (
        report.Cell.row("sampled", "1", "2", "3", report.Cell("[4]", "bad")),
        report.Cell.row(report.Cell("all", "head"), *[""] * 4),
    ),
    note="effects.wind.mean = [0, 0]",
)


def test_a_table_is_printed_with_group_headings_and_aligned_numbers() -> None:
    """Brackets are kept, a common start of headings is printed once, and numbers are aligned to the right."""
    lines = [line.rstrip() for line in output(TABLE).splitlines() if line.strip()]
    title, first, second, _, row, *_, note = lines
    assert title == "Error [mm]"
    assert first.split() == ["estimate", "measured"]
    assert second.split() == ["rung", "RMS", "max", "RMS", "bound", "[mm]"]
    assert row.split() == ["sampled", "1", "2", "3", "[4]"]
    assert row.index("1") == second.index("RMS") + 2
    assert note.strip() == "effects.wind.mean = [0, 0]"
    without_headings = report.Table("title", ("", ""), (report.Cell.row("gain", "2"),))
    assert output(without_headings).split() == ["title", "gain", "2"]


def test_marked_cells_are_coloured() -> None:
    coloured = Console(width=80, color_system="standard", force_terminal=True)
    with coloured.capture() as capture:
        coloured.print(screen_table(TABLE))
    (sampled,) = (line for line in capture.get().splitlines() if "sampled" in line)
    assert re.search(r"\x1b\[1;31m *\[4\]", sampled)
    assert "\x1b[1mall" in capture.get()


def test_long_cells_are_folded_except_in_the_first_column() -> None:
    words = "what a scenario is for, in some words"
    row = report.Cell.row("settled-trajectory", words, "1.5")
    text = output(report.Table("", ("name", "what it is", "[m]"), (row,), 2), width=40)
    assert "settled-trajectory" in text
    assert "1.5" in text
    assert words not in text
    assert [word for word in text.rpartition("─")[2].split() if word in words.split()] == words.split()
