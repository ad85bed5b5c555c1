"""The documentation site in a browser, without a network: search works, pages fit and are accessible."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from docs.build import build
from viewer.studio import accessibility_violations, open_page, poll_until

PAGES = ("index", "start", "how-to/index", "explanation/controllers", "reference/api", "reference/settings")
PAGES += ("reference/command-line", "proofs/performance")
WIDTHS = (1440, 1024, 390)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("site") / "docs"
    build(directory, gallery=False)
    return directory


def test_search_finds_a_page_without_a_server(site: Path, chromium: Browser) -> None:
    page = open_page(chromium)
    page.goto((site / "search.html").as_uri() + "?q=flatness")
    results = poll_until(
        lambda: page.locator("#search-results li a").all_inner_texts(), lambda texts: len(texts) > 1
    )
    assert any("Model" in text or "Controllers" in text for text in results)


def test_no_page_has_an_empty_bar_beside_it(site: Path) -> None:
    pages = {path: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    bars = {
        path: re.search(r'<nav class="bd-docs-nav.*?</nav>', text, re.DOTALL) for path, text in pages.items()
    }
    shown = {path: bar[0] for path, bar in bars.items() if bar}
    assert len(shown) > 20
    assert [path.name for path, bar in shown.items() if "<li" not in bar] == []


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_fits_and_is_accessible(site: Path, chromium: Browser, name: str, scheme: str) -> None:
    page = open_page(chromium, color_scheme=scheme)
    page.goto((site / f"{name}.html").as_uri())
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert accessibility_violations(page) == []
