"""Each erratum of docs/thesis/errata.md: the printed form fails, and the right form passes."""

import re

from tests.conftest import ROOT
from validation.thesis.errata import chapter_2, chapter_3, chapter_4, chapter_5  # noqa: F401, they register
from validation.thesis.errata.registry import ERRATA


def test_printed_forms_fail_and_corrected_forms_pass() -> None:
    for name, erratum in ERRATA.items():
        printed, right = erratum()
        assert printed > 1e-3, name
        assert right < 1e-9, name


def test_table_contains_exactly_the_checked_errata() -> None:
    page = (ROOT / "docs" / "thesis" / "errata.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| \*\*(.+?)\*\* \|", page, re.MULTILINE)
    assert listed == list(ERRATA)
