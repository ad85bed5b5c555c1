"""Draw the elements of block diagrams by schemdraw: block, sum, branch, signal, frame, label.

Positions are in drawing units, x to the right and y up. One unit is 36 px if a diagram has its natural width.
"""

import re
from typing import Literal
from xml.etree import ElementTree

from schemdraw import Drawing, Segment, SegmentBezier, SegmentPoly, SegmentText, svgconfig
from schemdraw.elements import Dot, Element
from schemdraw.flow import Box, Circle

Point = tuple[float, float]
Align = Literal["left", "center", "right"]

INK = "currentColor"
BLOCK_FILL = "var(--block, none)"
LINE, THIN, BUS = 1.5, 1.0, 4.0  # stroke widths [px]
TEXT, SMALL = 14.0, 12.0  # font sizes [px]
LINE_HEIGHT = 1.3  # of the font size
PX_PER_UNIT = 36.0
SUM_RADIUS = 0.2

# Position of a sign relative to the centre of its sum, by the side of the signal. It is beside the arrow.
SIGN_OFFSET = {"W": (-0.44, -0.25), "N": (-0.26, 0.44), "S": (0.26, -0.44)}

MARKS = r"[\u0300-\u036f\u20d0-\u20ff]*"  # dots and bars over a letter
SUBSCRIPT = re.compile(rf"_(\{{[^}}]*\}}|.{MARKS})")
# A single letter is a variable, in italics. Several letters are a word or a function such as sin.
LETTER = "[^\\W\\d_₀-₉]"
VARIABLE = re.compile(rf"(?<!{LETTER})({LETTER}{MARKS})(?!{LETTER})")
GREEK_VARIABLE = re.compile(rf"([α-ω]{MARKS})")


def new_drawing() -> Drawing:
    """Return an empty drawing in the common style."""
    return Drawing(canvas="svg", show=False, color=INK, lw=LINE, fontsize=TEXT, margin=0.15)


def block(d: Drawing, centre: Point, text: str, w: float = 1.2, h: float = 1.1) -> Element:
    """Draw a block with `text`; signals connect to its anchors N, E, S, W."""
    box = d.add(Box(w=w, h=h, fill=BLOCK_FILL).at(centre).anchor("center"))
    label(d, centre, text)
    return box


def integrator(d: Drawing, centre: Point) -> Element:
    """Draw an integrator."""
    return block(d, centre, "∫", w=0.9, h=0.9)


def summation(d: Drawing, centre: Point, **signs: str) -> Element:
    """Draw a sum; `signs` are by the side from which the signal comes, such as W="+", S="−"."""
    circle = d.add(Circle(r=SUM_RADIUS, fill=BLOCK_FILL).at(centre).anchor("center"))
    for side, sign in signs.items():
        dx, dy = SIGN_OFFSET[side]
        label(d, (centre[0] + dx, centre[1] + dy), sign, size=SMALL)
    return circle


def branch(d: Drawing, at: Point) -> None:
    """Draw the dot at which a signal branches."""
    d.add(Dot(radius=0.07).at(at))


def signal(d: Drawing, *path: Point, arrow: str | None = "->", lw: float = LINE) -> None:
    """Draw a line through all points of `path`, with an arrowhead unless `arrow` is None."""
    add(d, Segment(path, arrow=arrow, lw=lw, arrowlength=0.27, arrowwidth=0.19, joinstyle="miter"))


def input_from_above(d: Drawing, end: Point, text: str) -> None:
    """Draw an external signal from above down to `end`, with its name at its start."""
    signal(d, (end[0], end[1] + 1.3), end)
    label(d, (end[0], end[1] + 1.6), text)


def dashed(d: Drawing, *path: Point) -> None:
    """Draw a thin dashed line: a construction line or a frame."""
    add(d, Segment(path, ls="--", lw=THIN))


def frame(d: Drawing, low: Point, high: Point, text: str = "") -> None:
    """Draw a dashed frame around a part of the picture, with `text` in its upper left corner."""
    dashed(d, low, (low[0], high[1]), high, (high[0], low[1]), low)
    label(d, (low[0] + 0.2, high[1] - 0.32), text, align="left", size=SMALL)


def area(d: Drawing, *corners: Point, fill: str = BLOCK_FILL, lw: float = LINE) -> None:
    """Draw a filled polygon."""
    add(d, SegmentPoly(corners, fill=fill, lw=lw, joinstyle="round"))


def label(d: Drawing, at: Point, text: str, align: Align = "center", size: float = TEXT) -> None:
    """Draw text, vertically centred at `at`; `_x` or `_{xyz}` is a subscript."""
    lines = text.split("\n")
    step = LINE_HEIGHT * size / PX_PER_UNIT
    for i, line in enumerate(lines):
        y = at[1] + (0.5 * (len(lines) - 1) - i) * step
        add(d, SegmentText((at[0], y), line, align=(align, "center"), fontsize=size))


def add(d: Drawing, segment: Segment | SegmentBezier | SegmentPoly | SegmentText) -> None:
    """Add one drawing primitive, in the drawing's coordinates."""
    element = Element().at((0.0, 0.0))
    element.segments.append(segment)
    d.add(element)


def to_svg(d: Drawing, title: str) -> str:
    """Return the drawing as a scalable <svg> element in the text colour of its page."""
    svgconfig.text = "text"
    svg: ElementTree.Element = d.draw(show=False).getsvg()
    box = [_format(float(n)) for n in svg.attrib["viewBox"].split()]
    svg.attrib.clear()
    svg.attrib["viewBox"] = " ".join(box)
    svg.attrib["role"] = "img"
    svg.attrib["font-family"] = "sans-serif"
    svg.attrib["style"] = f"width:100%;max-width:{box[2]}px;height:auto"
    for shape in svg:
        if "style" in shape.attrib:
            shape.attrib["style"] = _clean_style(shape.attrib["style"])
        if shape.tag == "text":
            _typeset(shape)
    name = ElementTree.Element("title")
    name.text = title
    svg.insert(0, name)
    return re.sub(r"-?\d+\.\d{3,}", lambda n: _format(float(n[0])), ElementTree.tostring(svg, "unicode"))


def _format(value: float) -> str:
    """Format a number with at most two decimals, which are finer than a pixel and equal on every platform."""
    return f"{round(value, 2) + 0.0:.2f}".rstrip("0").rstrip(".")


def _clean_style(style: str) -> str:
    """Remove the invalid dash pattern of solid lines, shorten dashes, and unify the colour's spelling."""
    return (
        style.replace("stroke-dasharray:-;", "")
        .replace("stroke-dasharray:7.4,3.2", "stroke-dasharray:5,4")
        .replace("currentcolor", INK)
    )


def _typeset(text: ElementTree.Element) -> None:
    """Typeset one line: variables in italics, subscripts small and lowered, centred vertically.

    Browsers differ in baseline-shift and dominant-baseline, which schemdraw uses. So they are replaced.
    """
    line = "".join(text.itertext())
    size = float(text.attrib["font-size"])
    attributes = {name: text.attrib[name] for name in ("x", "fill", "font-size", "text-anchor")}
    attributes["y"] = _format(float(text.attrib["y"]) + 1.35 * size)
    text.clear()
    text.attrib.update(attributes)
    drop = 0.0
    for i, part in enumerate(SUBSCRIPT.split(line)):
        is_subscript = i % 2 == 1
        variables = GREEK_VARIABLE if is_subscript else VARIABLE
        for j, letters in enumerate(variables.split(part.strip("{}") if is_subscript else part)):
            if not letters:
                continue
            span = ElementTree.SubElement(text, "tspan")
            span.text = letters
            if j % 2 == 1:
                span.attrib["font-style"] = "italic"
            if is_subscript:
                span.attrib["font-size"] = _format(0.75 * size)
            target = 0.22 * size if is_subscript else 0.0
            if target != drop:
                span.attrib["dy"] = _format(target - drop)
                drop = target
