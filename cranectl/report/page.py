"""A report: one HTML page that needs nothing but itself, light or dark as its reader prefers."""

import io
from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure as Drawing
from PIL.Image import Image

from cranectl.report.table import Table
from cranectl.report.theme import SUBSCRIPT, css_variables, inline_svg, styled
from cranectl.support.files import write_text, writing


@dataclass(frozen=True)
class Figure:
    """A picture and what it shows; its number is its place in the page unless it has another."""

    title: str
    svg: str  # or another element
    caption: str
    alone: bool = False  # in its row
    number: str = ""

    @classmethod
    def drawn(
        cls, title: str, caption: str, draw: Callable[..., Drawing], *data: Any, **more: Any
    ) -> "Figure":
        """Return the figure that `draw(*data)` draws, in the page's style."""
        with styled():
            return cls(title, inline_svg(draw(*data)), caption, **more)

    @classmethod
    def pictured(cls, title: str, caption: str, picture: Image) -> "Figure":
        """Return a bitmap as a figure that the page itself contains."""
        data = io.BytesIO()
        picture.save(data, format="png", optimize=True)
        source = f"data:image/png;base64,{b64encode(data.getvalue()).decode()}"
        size = f'width="{picture.width}" height="{picture.height}"'
        return cls(title, f'<img src="{source}" alt="{escape(title)}" {size}>', caption)

    @property
    def markup(self) -> Markup:
        """The element as markup: it is ours and needs no escaping."""
        return Markup(self.svg)


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    anchor: str
    title: str
    paragraphs: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True)
class Page:
    """A whole report; `remade_by` is the command that makes it again."""

    title: str
    lead: str
    sections: tuple[Section, ...]
    remade_by: str


def render(page: Page) -> str:
    """Render the page as HTML."""
    environment = Environment(
        loader=PackageLoader("cranectl.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["typeset"] = typeset
    template = environment.get_template("page.html.jinja")
    light, dark = (Markup(css_variables(dark=dark)) for dark in (False, True))
    return template.render(page=page, light=light, dark=dark)


def typeset(text: str) -> Markup:
    """Text with the subscripts of its symbols."""
    return Markup(SUBSCRIPT.sub(r"\1<sub>\2</sub>", str(escape(text))))


def write_page(page: Page, path: Path) -> None:
    """Write the page in one atomic step; raise InputError if that fails."""
    with writing(path):
        write_text(path, render(page))
