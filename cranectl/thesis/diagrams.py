"""Diagrams of the model, the controllers and the simulation, numbered as the thesis's lost figures.

Each is our own drawing of our own system: right signs, our symbols. `validation/diagrams/draw.py` draws them,
in the page's text colour; a page may set the CSS variables --block (fill of blocks, none by default) and
--forbidden (fill of the bounds in 4.6, as blocks by default).
"""

from typing import NamedTuple

from cranectl.support import resources
from cranectl.support.documents import read_toml

DIRECTORY = resources.THESIS_DIRECTORY / "diagrams"
TEXTS = read_toml(resources.THESIS_DIRECTORY / "diagrams.toml")


class Diagram(NamedTuple):
    """What stands beside a picture."""

    title: str
    note: str  # what it shows, and what the thesis prints wrongly


DIAGRAMS = {number: Diagram(**texts) for number, texts in TEXTS.items()}


def diagram_svg(number: str) -> str:
    """The diagram `number` as an <svg> element for a page."""
    return (DIRECTORY / f"{number}.svg").read_text(encoding="utf-8").rstrip()
