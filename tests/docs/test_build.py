"""The pages that are made from data are whole, and so are the data."""

import re
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import cranectl
from cranectl.tools.benchmark.settings import Benchmark
from docs import build, figures, gallery_style
from tests.conftest import ROOT
from validation.performance import page as performance
from validation.proofs import mutation_results as mutations


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("docs") / "source"
    build.stage(directory)
    return directory


def test_all_pages_are_built_from_the_data_of_the_repository(source: Path) -> None:
    page = (source / "extra" / build.BENCHMARK).read_text(encoding="utf-8")
    assert f">{Benchmark.read('literature').baseline}<" in page
    assert page.count("<svg") > 5
    mutated = (source / "proofs" / "mutations.md").read_text(encoding="utf-8")
    functions = re.findall(r"^## `(.*)`$", mutated, re.MULTILINE)
    assert functions == list(mutations.read_results(mutations.DATA))
    figures, times = performance.read_results()
    measured = (source / "proofs" / "performance.md").read_text(encoding="utf-8")
    for name in (*(figure.name for figure in figures), *(f"`{row.law}`" for row in times)):
        assert f"\n| {name} | " in measured, name
    assert "| core hours |" in measured
    for text in (mutated, measured):
        headings = re.findall(r"^\|(.*)\|\n\|[-|: ]+\|$", text, re.MULTILINE)
        assert headings
        assert all(cell.strip() for row in headings for cell in row.split("|"))


def test_every_page_is_in_the_list_of_all_pages() -> None:
    docs = ROOT / "docs"
    sections = build.read_sections((docs / "index.md").read_text(encoding="utf-8"))
    listed = {path for links in sections.values() for path in build.pages_of(links)}
    pages = {path.relative_to(docs).as_posix() for end in ("md", "rst") for path in docs.rglob(f"*.{end}")}
    assert pages - {"index.md"} <= listed


def test_links_hold_at_their_new_place(source: Path) -> None:
    """Sphinx checks links to pages; a link to another file needs its copy."""
    original, rest = (
        "validation/benchmark/literature.toml",
        "[b](../start.md#x) [c](https://example.org/d.md)\n",
    )
    page = ROOT / "docs" / "how-to" / "a.md"
    moved = build.move_links(f"[a](../../{original}) {rest}", page, "how-to/a.md", source)
    assert moved == f"[a](../files/{original}) {rest}"
    assert (source / "files" / original).read_bytes() == (ROOT / original).read_bytes()


def test_the_api_page_has_every_public_name() -> None:
    page = (ROOT / "docs" / "reference" / "api.rst").read_text(encoding="utf-8")
    described = re.findall(r"^\.\. (?:auto\w+|data):: (\w+)", page, re.MULTILINE)
    assert sorted(described) == sorted(cranectl.__all__)
    (example,) = re.findall(r"code-block:: python\n\n((?:    .*\n|\n)+)", page)
    names: dict[str, Any] = {}
    exec(textwrap.dedent(example).replace("print(", "result = ("), names)
    assert 0.0 <= names["result"] < 1e-7


def test_examples_are_numbered_and_short_and_use_what_is_public() -> None:
    """`make docs` runs them."""
    scripts = sorted((ROOT / "docs" / "gallery").glob("*.py"))
    assert len(scripts) >= 11
    for number, script in enumerate(scripts, 1):
        text = script.read_text(encoding="utf-8")
        assert script.name.startswith(f"{number:02}_")
        assert len(text.splitlines()) <= 40, script.name
        assert not re.search(r"cranectl[.]\w+[.]|from cranectl", text), script.name
        assert re.match(r'"""\n.+\n=+\n\n', text), script.name


def test_thumbnails_show_a_part_of_the_figure_of_an_example() -> None:
    """A red quarter of a white figure fills the thumbnail that shows this quarter."""
    scripts = {path.stem for path in (ROOT / "docs" / "gallery").glob("*.py")}
    assert set(gallery_style.SHOWN) <= scripts
    for left, top, right, bottom in gallery_style.SHOWN.values():
        assert 0.0 <= left < right <= 1.0
        assert 0.0 <= top < bottom <= 1.0
    figure = Image.new("RGB", (2000, 1400), "white")
    figure.paste((255, 0, 0), (1000, 700, 2000, 1400))
    cropped = gallery_style.thumbnail(figure, (0.5, 0.5, 1.0, 1.0))
    whole = gallery_style.thumbnail(figure)
    assert cropped.size == whole.size == gallery_style.THUMBNAIL
    assert cropped.getcolors() == [(400 * 280, (255, 0, 0))]
    assert whole.getpixel((100, 70)) == (255, 255, 255)
    assert whole.getpixel((300, 210)) == (255, 0, 0)


def test_a_picture_without_a_description_is_found(tmp_path: Path) -> None:
    """A thumbnail stands beside its title."""
    described = '<img src="a.png" alt="the load of a fast move" /><a><img alt="" src="thumb.png" /></a>'
    words = ('src="1.png"', 'alt="" src="2.png"', 'alt="10 live" src="3.png"', 'src="4.png" alt="drives"')
    others = "".join(f"<img {attributes} />" for attributes in words)
    (tmp_path / "page.html").write_text(f"<p>{described}{others}</p>", encoding="utf-8")
    assert build.undescribed_pictures(tmp_path) == [f"page.html: {k}.png" for k in (1, 2, 3, 4)]


def test_figures_are_those_that_the_script_draws(tmp_path: Path) -> None:
    """After a change of the script or of the physics: python docs/figures.py."""
    figures.main(tmp_path)
    for name in figures.FIGURES:
        new, old = (
            np.asarray(Image.open(folder / f"{name}.png").convert("L"), dtype=float)
            for folder in (tmp_path, figures.PICTURES)
        )
        assert new.shape == old.shape
        assert np.abs(new - old).mean() < 1.0, name


def test_the_data_of_performance_are_read_as_they_are_written(tmp_path: Path) -> None:
    results = performance.read_results()
    performance.write_results(*results, tmp_path / "performance.json")
    assert performance.read_results(tmp_path / "performance.json") == results


def test_pages_that_are_built_are_not_tracked() -> None:
    assert [path.name for path in (ROOT / "docs" / "proofs").iterdir()] == ["reliability.md"]
