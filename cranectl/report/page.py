"""A report as one HTML page that loads nothing else, in light or dark colours as its reader prefers."""

import io
import re
from base64 import b64encode
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure as Drawing
from PIL.Image import Image

from cranectl.report.table import Cell, Table
from cranectl.report.theme import Chart
from cranectl.support import File, FileKind


@dataclass(frozen=True)
class Figure:
    """A picture with its title and caption; its place in the page numbers it unless `number` does."""

    title: str
    svg: str  # or another element
    caption: str
    alone: bool = False  # in its row
    number: str = ""
    png: bytes = b""  # of a bitmap, which `svg` embeds

    @classmethod
    def drawn(
        cls, title: str, caption: str, draw: Callable[..., Drawing], *data: Any, **more: Any
    ) -> "Figure":
        """Return the figure that `draw(*data)` draws, in the page's style."""
        with Chart.styled():
            return cls(title, Chart.inline_svg(draw(*data)), caption, **more)

    @classmethod
    def pictured(cls, title: str, caption: str, picture: Image) -> "Figure":
        """Return a bitmap as a figure that the page itself contains."""
        data = io.BytesIO()
        picture.save(data, format="png", optimize=True)
        source = f"data:image/png;base64,{b64encode(data.getvalue()).decode()}"
        size = f'width="{picture.width}" height="{picture.height}"'
        element = f'<img src="{source}" alt="{escape(title)}" {size}>'
        return cls(title, element, caption, png=data.getvalue())

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
class Fact:
    """One number of the first screen: what it is, its value with the unit, and a remark below it."""

    name: str
    value: str
    remark: str = ""
    mark: str = ""  # as of a cell


@dataclass(frozen=True)
class FirstScreen:
    """The first screen of a page: a verdict with its reason, a few numbers, and pictures beside them."""

    verdict: Cell
    reason: str
    facts: tuple[Fact, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True)
class Page:
    """A whole report; `remade_by` is the command that makes it again."""

    title: str
    lead: str
    sections: tuple[Section, ...]
    remade_by: str
    first_screen: FirstScreen | None = None

    @property
    def figures(self) -> Iterator[Figure]:
        """All figures in the order of the page."""
        yield from self.first_screen.figures if self.first_screen else ()
        for section in self.sections:
            yield from section.figures

    def write(self, path: Path) -> None:
        """Write the page in one atomic step; raise InputError if that fails."""
        with File(path).writing():
            File(path).write_text(render(self))

    def write_figures(self, directory: Path) -> int:
        """Write each figure of the page as a file named by its title; return how many.

        Drawings become SVG files in the colours of light pages, bitmaps PNG files. Raises InputError for a
        file that cannot be written or that another kind of file would replace.
        """
        taken: Counter[str] = Counter()
        for figure in self.figures:
            name = re.sub(r"[^\w.]+", "-", f"{figure.number} {figure.title}".lower()).strip("-")
            taken[name] += 1
            name += f"-{taken[name]}" if taken[name] > 1 else ""
            path = directory / f"{name}.{'png' if figure.png else 'svg'}"
            FileKind.of(path, FileKind.PLOTS).check_place(path, option="--figures")
            with File(path).writing(), File(path).replacing() as part:
                part.write_bytes(figure.png or Chart.standalone_svg(figure.svg).encode())
        return taken.total()


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
    light, dark = (Markup(Chart.css_variables(dark=dark)) for dark in (False, True))
    return template.render(page=page, light=light, dark=dark)


def typeset(text: str) -> Markup:
    """Return text with the subscripts of its symbols."""
    return Markup(Chart.SUBSCRIPT.sub(r"\1<sub>\2</sub>", str(escape(text))))
