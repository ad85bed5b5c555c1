"""The metadata of a release: version, date, citation, changelog."""

import re
import tomllib

import yaml

from tests.conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_citation_has_the_required_fields() -> None:
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["type"] == "software"
    assert CITATION["message"]
    assert CITATION["title"]
    (thesis,) = CITATION["references"]
    assert {"type", "title", "authors", "institution", "year"} <= thesis.keys()


def test_the_citation_matches_this_version() -> None:
    for name in ("version", "license", "keywords"):
        assert CITATION[name] == PROJECT[name]
    assert CITATION["authors"] == PROJECT["authors"]
    assert f"## {PROJECT['version']} ({CITATION['date-released']})\n" in CHANGELOG
    bibtex = (ROOT / "docs" / "thesis" / "thesis.md").read_text(encoding="utf-8")
    for field, value in (("version", PROJECT["version"]), ("year", str(CITATION["date-released"])[:4])):
        assert re.search(rf"\b{field} += \{{{re.escape(value)}\}}", bibtex), field
    assert f"{{{CITATION['title']}}}" in bibtex


def test_the_citation_and_the_readme_name_the_same_thesis() -> None:
    (thesis,) = CITATION["references"]
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"*{thesis['title']}*" in readme
    assert f"{thesis['authors'][0]['family-names']}, *" in readme
    assert str(thesis["year"]) in readme


def test_the_classifiers_match_the_tested_systems() -> None:
    systems = [text for text in PROJECT["classifiers"] if text.startswith("Operating System")]
    assert systems == ["Operating System :: POSIX :: Linux"]
    versions = [text.rpartition(" ")[2] for text in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", text)]
    assert versions[0] == PROJECT["requires-python"].removeprefix(">=")


def test_the_changelog_has_short_lines_in_order() -> None:
    """Each change has one line, and the newest version comes first, so that users can read all of it."""
    lines = CHANGELOG.splitlines()
    assert len(lines) <= 150
    assert [line for line in lines if len(line) > 200] == []
    head = CHANGELOG.index("## ")
    assert re.sub(r"^(- |## |### ).+$", "", CHANGELOG[head:], flags=re.MULTILINE).strip() == ""
    kinds = {line[4:] for line in lines if line.startswith("### ")}
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    versions = [
        tuple(map(int, numbers))
        for numbers in re.findall(r"^## (\d+)\.(\d+)\.(\d+)", CHANGELOG, re.MULTILINE)
    ]
    assert versions == sorted(versions, reverse=True)


def test_links_of_the_changelog_have_targets() -> None:
    targets = re.findall(r"\]\(([^)#]+)", CHANGELOG)
    assert len(targets) > 50
    for target in targets:
        assert target.startswith("https://") or (ROOT / target).exists(), target


def test_the_example_requires_this_version() -> None:
    """The example uses the pytest plugin of this version."""
    example = tomllib.loads((ROOT / "examples/harbour-crane/pyproject.toml").read_text(encoding="utf-8"))
    (requirement,) = (text for text in example["project"]["dependencies"] if text.startswith("cranectl"))
    assert requirement == f"cranectl>={PROJECT['version'].rpartition('.')[0]}"
