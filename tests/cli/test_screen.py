"""What comes from outside is text on a screen and nothing else; no number is cut by a narrow one."""

import io
import re

import pytest
from rich.console import Console
from rich.text import Text

from cranectl.cli.output import Screen, heading, screen_table, styled
from cranectl.report import table as report
from cranectl.support.errors import MAX_PHRASE, printable

MALICE = "e[red].mcap [/] \x1b[2J\x07 a\nforged: line\r \u202e\u2028 \udcff :smile:"


def screen(width: int = 80) -> Screen:
    made = Screen(stderr=False)
    made.file, made.width = io.StringIO(), width
    return made


def shown(on: Screen) -> str:
    assert isinstance(on.file, io.StringIO)
    return on.file.getvalue()


@pytest.mark.parametrize("place", ["line", "style", "cell", "heading", "title"])
def test_text_from_outside_is_one_line_of_characters(place: str) -> None:
    on = screen(200)
    table = report.Table("t", ("h", "i"), ((report.Cell(MALICE, "bad"), report.Cell("1")),))
    if place == "line":
        on.print(MALICE)
    elif place == "style":
        on.print("before", styled(MALICE, "bold"))
    elif place == "cell":
        on.print(table)
    elif place == "heading":
        on.print(report.Table("t", (MALICE.replace("\n", " "), "i"), table.rows))
    else:
        on.print(report.Table(MALICE, ("h", "i"), table.rows))
    text = shown(on)
    together = "".join(line.strip() for line in text.split("\n"))  # a title is folded to its table
    for part in ("e[red].mcap[/]", ":smile:", r"\x1b[2J\x07", r"\udcff"):
        assert part in together.replace(" ", "")
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e\u2028\ud800-\udfff]", text)
    assert "\nforged" not in text


def test_length_has_an_end() -> None:
    text = printable("a" * 10_000_000)
    assert len(text) < MAX_PHRASE + 50
    assert "9999500 characters" in text
    assert printable("short ẍ_c") == "short ẍ_c"


NUMBERS = [f"{k}.67e-0{k}" for k in range(9)]


@pytest.mark.parametrize("width", [200, 80, 40, 12])
def test_no_number_is_cut(width: int) -> None:
    headings = ("what is measured", *(f"heading {k}\n[mm]" for k in range(9)))
    on = screen(width)
    on.print(report.Table("", headings, (report.cells("friction of the axes", *NUMBERS),)))
    text = shown(on)
    assert all(number in text for number in NUMBERS)
    assert "…" not in text
    assert text.count("friction of the axes") == (1 if width == 200 else text.count("what is measured"))


def test_parts_keep_title_note_and_groups() -> None:
    """A heading that stands over several columns stands over each part that has some of them."""
    headings = ("rung", *(f"error [mm]\n{name}" for name in ("RMS", "max", "final")), "sway\n[°]")
    cells = tuple(report.Cell(text) for text in ("servos", "1.0", "2.0", "3.0", "4.0"))
    table = report.Table("what each rung adds", headings, (cells,), note="a note")
    on = screen(23)
    on.print(table)
    text = shown(on)
    assert text.count("what each rung") == text.count("a note") == 1
    assert text.index("what each rung") < text.index("servos") < text.rindex("servos") < text.index("a note")
    assert text.count("servos") == 3
    assert text.count("error [mm]") == 2, "RMS and max; final; sway"
    wide = screen(200)
    wide.print(table)
    assert shown(wide).count("error [mm]") == 1


def test_lines_are_not_wrapped() -> None:
    on = screen(23)
    on.print("log:", "a" * 50)
    assert shown(on) == "log: " + "a" * 50 + "\n"


def test_own_headings_may_have_several_lines() -> None:
    assert heading("a\nb") == Text("a\nb")


def test_columns_move_together_before_a_table_goes_in_parts() -> None:
    cells = (report.Cell("row"), *map(report.Cell, NUMBERS[:8]))
    table = report.Table("t", ("", *"abcdefgh"), (cells,))
    wide, narrow = screen(200), screen(80)
    for on in (wide, narrow):
        on.print(table)
        assert shown(on).count("row") == 1
    widths = [len(max(shown(on).splitlines(), key=len)) for on in (wide, narrow)]
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


def test_a_table_on_the_screen() -> None:
    """Brackets as they are, what neighbouring headings begin with said once, numbers on the right."""
    on = screen()
    on.print(TABLE)
    title, first, second, _, row, *_, note = [
        line.rstrip() for line in shown(on).splitlines() if line.strip()
    ]
    assert title == "Error [mm]"
    assert first.split() == ["estimate", "measured"]
    assert second.split() == ["rung", "RMS", "max", "RMS", "bound", "[mm]"]
    assert row.split() == ["sampled", "1", "2", "3", "[4]"]
    assert row.index("1") == second.index("RMS") + 2
    assert note.strip() == "effects.wind.mean = [0, 0]"
    on = screen()
    on.print(report.Table("title", ("", ""), (report.cells("gain", "2"),)))
    assert [line.split() for line in shown(on).splitlines() if line.strip()] == [["title"], ["gain", "2"]]


def test_marks_have_colours() -> None:
    coloured = Console(width=80, color_system="standard", force_terminal=True)
    with coloured.capture() as capture:
        coloured.print(screen_table(TABLE))
    (sampled,) = (line for line in capture.get().splitlines() if "sampled" in line)
    assert re.search(r"\x1b\[1;31m *\[4\]", sampled)
    assert "\x1b[1mall" in capture.get()


def test_texts_fold_where_there_is_no_room_but_never_the_first_column() -> None:
    words = "what a scenario is for, in some words"
    on = screen(40)
    on.print(
        report.Table(
            "", ("name", "what it is", "[m]"), (report.cells("settled-trajectory", words, "1.5"),), 2
        )
    )
    text = shown(on)
    assert "settled-trajectory" in text
    assert "1.5" in text
    assert words not in text
    assert [word for word in text.rpartition("─")[2].split() if word in words.split()] == words.split()
