"""Diagrams of the thesis: complete, with correct labels and signs, and fit for a page."""

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest

from cranectl.support.resources import Shipped
from cranectl.tools.thesis.page import DIAGRAMS, diagram_svg
from tests.conftest import ROOT

DRAW = ROOT / "validation" / "thesis" / "drawing" / "draw.py"

SVG = "{http://www.w3.org/2000/svg}"

# Every text of every diagram; subscripts lose their underscore, and ~ is a blank.
TEXTS = {
    "2.1": "x y z x_c y_c l α β bridge trolley load~z",
    "3.1": "trajectory generation z_d~…~z⃛_d z_d⁗ e K v v₃ ∫ ∫ ζ̇ ζ dynamic extension linearising~law "
    "u~=~φ(x,~ζ,~ζ̇)~+~γ(x,~ζ)~v u crane d_α,~d_β x z flat~coordinates (x,~ζ,~ζ̇)~→~z,~ż,~z̈,~z⃛ z~…~z⃛ + − + +",
    "4.2": "z_d~…~z⃛_d z_d⁗ e K v ∫ ∫ ∫ ∫ z⃛ z̈ ż z z~…~z⃛ + − + +",
    "4.3": "z_d~…~z⃛_d z_d⁗ e K v̄ v ∫ ∫ ∫ ∫ z⃛ z̈ ż z z~…~z⃛ + − + + + + G(s):~from~v̄~to~z",
    "4.4": "P(s) K(s) w z u v",
    "4.5": "P(s) G(s) W_s(s) W_ks(s) K(s) w e z₁ z₂ v~=~e u~=~v̄ + −",
    "4.6": "singular~values~of~G_s~in~dB log~ω 0 σ̄(G_s) σ̲(G_s) performance: stay~above "
    "robustness: stay~below crossover",
    "4.7": "W_e G W_a G_s(s)~=~W_a~G~W_e",
    "4.8": "W_e G W_a G_s(s) K_∞",
    "4.9": "W_a K_∞ W_e K(s)~=~W_e~K_∞~W_a G v̄ z",
    "5.1": "reference z_d~…~z_d⁗ tracker tracker the~same~law for~both u u analytic plant MuJoCo plant "
    "d_α,~d_β q,~q̇ q,~q̇ q,~q̇,~z q,~q̇,~z log comparison",
    "5.2": "u g(x) + + + d_α,~d_β ẋ ∫ x f(x)",
    "5.3": "x ζ ζ̇ flat coordinates Φ(x,~ζ,~ζ̇) z ż z̈ z⃛ z_d ż_d z̈_d z⃛_d e ė ë e⃛ + + + + − − − −",
    "5.4": "v v₃ ∫ ∫ ζ̇ ζ x γ(x,~ζ) φ(x,~ζ,~ζ̇) + + u",
    "5.5": "z_d~…~z⃛_d e K z_d⁗ v̄ v linearised~crane z⁗~=~v z~…~z⃛ + − + + +",
    "5.6": "z_d~…~z⃛_d e K R(s) z_d⁗ v̄ v linearised~crane z⁗~=~v z~…~z⃛ + − + + +",
}

FILLS = {"currentColor", "none", "var(--block, none)", "var(--forbidden, var(--block, none))"}
PICTURES = {number: ElementTree.fromstring(diagram_svg(number)) for number in TEXTS}


def texts(svg: ElementTree.Element) -> Counter[str]:
    return Counter("".join(text.itertext()) for text in svg.iter(f"{SVG}text"))


def colours(svg: ElementTree.Element) -> set[str]:
    """Return all values of fill and stroke, in attributes and styles."""
    found = set()
    for shape in svg.iter():
        style = dict(part.split(":", 1) for part in shape.get("style", "").split(";") if part)
        found |= {
            values[name] for values in (shape.attrib, style) for name in ("fill", "stroke") if name in values
        }
    return found


def points(shape: ElementTree.Element) -> list[tuple[float, float]]:
    """Return the corners of a shape, or of the box around a circle."""
    if shape.tag == f"{SVG}circle":
        x, y, r = (float(shape.attrib[name]) for name in ("cx", "cy", "r"))
        return [(x - r, y - r), (x + r, y + r)]
    if shape.tag == f"{SVG}text":
        return [(float(shape.attrib["x"]), float(shape.attrib["y"]))]
    numbers = [float(n) for n in re.findall(r"-?\d+\.?\d*", shape.get("d", "") + shape.get("points", ""))]
    return list(zip(numbers[::2], numbers[1::2], strict=True))


def test_every_diagram_has_a_title_and_a_note() -> None:
    assert list(DIAGRAMS) == list(TEXTS)
    assert all(texts["title"] and texts["note"].endswith(".") for texts in DIAGRAMS.values())


def test_the_shipped_diagrams_are_those_that_the_program_draws(tmp_path: Path) -> None:
    """Drawn in another process, since drawing depends on its sources only."""
    subprocess.run([sys.executable, str(DRAW), str(tmp_path)], cwd=ROOT, check=True)
    drawn, shipped = (
        {path.name: path.read_text(encoding="utf-8") for path in place.iterdir()}
        for place in (tmp_path, Shipped.THESIS_FOLDER / "diagrams")
    )
    assert set(shipped) == {f"{number}.svg" for number in DIAGRAMS}
    assert drawn == shipped, "run `python validation/thesis/drawing/draw.py`"


@pytest.mark.parametrize("number", TEXTS)
def test_a_diagram_has_its_labels_and_fits_any_page(number: str) -> None:
    """It scales, takes its colours from the page, and has no identifiers, references, styles or scripts."""
    svg, text = PICTURES[number], diagram_svg(number)
    assert texts(svg) == Counter(word.replace("~", " ").replace("_", "") for word in TEXTS[number].split(" "))
    assert svg.tag == f"{SVG}svg"
    assert svg.get("role") == "img"
    assert svg.findtext(f"{SVG}title") == DIAGRAMS[number]["title"]
    assert not {"width", "height"} & set(svg.attrib)
    left, top, width, height = svg.attrib["viewBox"].split()
    assert f"max-width:{width}px" in svg.attrib["style"]
    assert 200.0 < float(width) < 780.0
    assert "currentColor" in colours(svg) <= FILLS
    assert text.startswith("<svg ")
    assert not re.search(r"\bid=|href|url\(|<style|<script|<!", text)
    assert re.findall(r"https?://[^\"]*", text) == [SVG.strip("{}")]
    for x, y in (point for shape in svg for point in points(shape)):  # no shape is cut off
        assert float(left) <= x <= float(left) + float(width)
        assert float(top) <= y <= float(top) + float(height)


def test_the_error_is_reference_minus_measurement() -> None:
    """The minus is where the load's coordinates enter: from below in a loop, else from the left."""
    for number in ("3.1", "4.2", "4.3", "4.5", "5.3", "5.5", "5.6"):
        svg = PICTURES[number]
        sums = [c for c in svg.iter(f"{SVG}circle") if float(c.attrib["r"]) > 5.0]
        minuses = [text for text in svg.iter(f"{SVG}text") if "".join(text.itertext()) == "−"]
        assert minuses
        for minus, circle in zip(minuses, sums, strict=False):  # the sum of the error is drawn first
            right, below = (float(minus.attrib[i]) - float(circle.attrib[f"c{i}"]) for i in "xy")
            if number in ("4.5", "5.3"):
                assert -20.0 < right < -7.0, number
                assert 7.0 < below < 20.0, number
            else:
                assert 5.0 < right < 12.0, number
                assert 12.0 < below < 25.0, number
