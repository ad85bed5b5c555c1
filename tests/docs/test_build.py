"""The pages that are made from data are whole, and so are the data."""

import re
from pathlib import Path

import pytest

from cranectl.campaign.benchmark.settings import read_benchmark
from docs import build
from tests.conftest import ROOT
from validation.performance import page as performance
from validation.proofs import mutation_results as mutations


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("docs") / "build"
    build.build(directory)
    return directory


def test_all_pages_are_built_from_the_data_of_the_repository(built: Path) -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in built.iterdir()}
    assert texts.keys() == {"literature.html", "mutations.md", "performance.md"}
    baseline = read_benchmark("literature").baseline
    assert f">{baseline}<" in texts["literature.html"]
    assert texts["literature.html"].count("<svg") > 5
    functions = re.findall(r"^## `(.*)`$", texts["mutations.md"], re.MULTILINE)
    assert functions == list(mutations.read_results(mutations.DATA))
    figures, times = performance.read_results()
    for name in (*(each.name for each in figures), *(f"`{each.law}`" for each in times)):
        assert f"\n| {name} | " in texts["performance.md"], name
    assert "| core hours |" in texts["performance.md"]


def test_the_data_of_performance_are_read_as_they_are_written(tmp_path: Path) -> None:
    results = performance.read_results()
    performance.write_results(*results, tmp_path / "performance.json")
    assert performance.read_results(tmp_path / "performance.json") == results


def test_pages_that_are_built_are_not_tracked() -> None:
    assert [path.name for path in (ROOT / "docs" / "proofs").iterdir()] == ["reliability.md"]
