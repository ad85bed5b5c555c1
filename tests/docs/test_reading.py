"""The page that leads through the code names what exists, and is short enough for a day."""

import re
from pathlib import Path

import pytest

from docs import reading

TEXT = reading.PAGE.read_text(encoding="utf-8")


def test_the_page_has_ten_stops_with_at_most_the_lines_that_it_promises() -> None:
    """After a change of code, `python docs/reading.py` shows the lines of each stop."""
    stops = reading.read_stops(TEXT)
    assert [title.partition(".")[0] for title in stops] == [str(k) for k in range(1, reading.STOPS + 1)]
    assert all(entry.file.is_file() for entries in stops.values() for entry in entries)
    counts = reading.count_lines(stops)  # raises KeyError for a name that a file does not define
    assert min(counts.values()) > 0
    assert sum(counts.values()) <= reading.MAX_LINES
    assert f"at most {reading.MAX_LINES} lines" in TEXT


def test_every_item_of_a_stop_is_understood() -> None:
    """Otherwise its lines would not count."""
    numbered = TEXT.partition("\n## 1.")[2].partition("\n## Where")[0]
    items = re.findall(r"^- ", numbered, re.MULTILINE)
    assert len(items) == sum(map(len, reading.read_stops(TEXT).values())) > 20


@pytest.fixture
def page(tmp_path: Path) -> Path:
    (tmp_path / "code.py").write_text(
        '"""Say a thing."""\n\nSIZE = 2  # of it\n\n\nclass Box:\n    """Hold it."""\n\n    width: float\n\n'
        "    @property\n    def area(self):\n        return self.width**2\n\n"
        "    def other(self):\n        pass\n",
        encoding="utf-8",
    )
    return tmp_path / "page.md"


def test_a_method_is_read_with_the_head_of_its_class(page: Path) -> None:
    part = "- [`code.py`](code.py): `SIZE`,\n  `Box.area`.\n  Look.\n"
    text = f"## 1. One\n\n{part}- [`code.py`](code.py). All.\n"
    stops = reading.read_stops(text, page)
    first, whole = stops["1. One"]
    assert {name: len(lines) for name, lines in first.parts().items()} == {
        "docstring": 1,
        "SIZE": 1,
        "Box": 5,
        "Box.area": 3,
    }
    assert first.code(first.parts()["Box.area"]).startswith("    @property\n    def area")
    assert reading.count_lines(stops) == {"1. One": 16}
    assert reading.count_lines({"a": [first], "b": [first]}) == {"a": 10, "b": 0}
    assert len(whole.parts()["whole file"]) == 16


def test_a_name_that_is_gone_is_found(page: Path) -> None:
    (entry,) = reading.read_stops("## 1. One\n\n- [`code.py`](code.py): `Box.gone`. It.\n", page)["1. One"]
    with pytest.raises(KeyError, match=r"Box\.gone"):
        entry.parts()


def test_the_site_shows_the_code_below_each_entry(page: Path) -> None:
    shown = reading.with_code("## 1. One\n\n- [`code.py`](code.py): `Box.area`. Look.\n\nEnd.\n", page)
    assert "<summary><code>Box.area</code>, 3 lines</summary>" in shown
    assert "  ~~~~python\n      @property\n      def area(self):\n" in shown
    assert shown.endswith("\n\nEnd.\n")
