"""What a release says of itself: version, date, citation, changelog."""

import re
import tomllib

import yaml

from tests.conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_citation_has_what_its_format_requires() -> None:
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["type"] == "software"
    assert CITATION["message"]
    assert CITATION["title"]
    (thesis,) = CITATION["references"]
    assert {"type", "title", "authors", "institution", "year"} <= thesis.keys()


def test_the_citation_is_of_this_version() -> None:
    for name in ("version", "license", "keywords"):
        assert CITATION[name] == PROJECT[name]
    assert CITATION["authors"] == PROJECT["authors"]
    assert f"## {PROJECT['version']} ({CITATION['date-released']})\n" in CHANGELOG


def test_the_citation_has_the_thesis_as_the_readme_has_it() -> None:
    (thesis,) = CITATION["references"]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"*{thesis['title']}*" in readme
    assert f"{thesis['authors'][0]['family-names']}, *" in readme
    assert str(thesis["year"]) in readme


def test_the_classifiers_claim_what_is_tested() -> None:
    systems = [each for each in PROJECT["classifiers"] if each.startswith("Operating System")]
    assert systems == ["Operating System :: POSIX :: Linux"]
    versions = [each.rpartition(" ")[2] for each in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", each)]
    assert versions[0] == PROJECT["requires-python"].removeprefix(">=")
