"""The documentation site in a browser, without a network: search works, pages fit and are accessible."""

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


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_fits_and_is_accessible(site: Path, chromium: Browser, name: str, scheme: str) -> None:
    page = open_page(chromium, color_scheme=scheme)
    page.goto((site / f"{name}.html").as_uri())
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert accessibility_violations(page) == []
