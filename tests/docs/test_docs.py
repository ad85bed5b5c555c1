"""Every code block of README and docs runs and prints what is shown, and what they say of the code is so."""

import re
import shlex
import subprocess
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.controllers.registry import OPEN
from cranectl.loaders.opening import close_controllers
from tests.conftest import ROOT
from tests.tools.export.loaders.fmu_files import fmu

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
ALL_PAGES = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
WITHOUT_CODE = (  # but results and tables
    "commands errata exit-codes flatness glossary index limits measured reliability settings signals "
    "standards standings systems thesis topics"
)
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
ANY_TEXT = "…"  # in a shown output: of any other text in its line, or alone in a line of any lines


def blocks(page: Path) -> list[tuple[str, str]]:
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def is_printed(shown: str, printed: str) -> bool:
    """Return True if an output is what a page shows, spaces at the end of a line aside."""
    lines = [
        r"(?:.*\n)*?" if line.strip() == ANY_TEXT else re.escape(line).replace(ANY_TEXT, ".*") + r"\n"
        for line in shown.splitlines()
    ]
    told = "".join(f"{line.rstrip()}\n" for line in printed.splitlines())
    return re.fullmatch("".join(lines), told) is not None


def is_shown_failure(page: Path, printed: str) -> bool:
    """Return True if pytest printed the lines of a failed test that a page shows, indented."""
    shown = re.findall(rf"^    (E .*|{ANY_TEXT})$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return len(shown) > 1 and is_printed("\n".join([ANY_TEXT, *shown, ANY_TEXT]), printed)


@pytest.fixture
def forgotten() -> Iterator[None]:
    """What a page registers is not known to later tests."""
    before = dict(OPEN.registered)
    yield
    close_controllers()
    OPEN.registered.clear()
    OPEN.registered.update(before)


def test_there_are_pages_and_blocks() -> None:
    assert len(PAGES) >= 4
    assert all(blocks(page) for page in PAGES if page.stem not in WITHOUT_CODE.split())
    languages = {language for page in PAGES for language, _ in blocks(page)}
    assert languages == {"c", "python", "sh", "text", "toml"}


def run_line(line: str) -> None:
    """Run a line of a page, which ends with exit code 0 unless its comment says `exit code CODE`."""
    said = re.search(r"# exit code (\d)$", line)
    program, *arguments = shlex.split(line, comments=True)
    if program == "cc" or program.startswith("./"):
        result = subprocess.run([program, *arguments], check=True, stdout=subprocess.PIPE, text=True)
        print(result.stdout, end="")
    else:
        assert program == "cranectl"
        assert main(arguments) == int(said[1] if said else 0), line


@pytest.mark.usefixtures("forgotten")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_code_blocks_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the order of the page and in one directory.

    A TOML block is saved under its name. One of Python or C that begins with the name of a file is saved too.
    A block of text is what the Python or the last command before it prints.
    """
    monkeypatch.chdir(tmp_path)
    Path("examples").symlink_to(ROOT / "examples")  # as in a checkout
    if any("law.fmu" in text for _, text in blocks(page)):
        fmu(tmp_path / "law.fmu", 2)  # as a tool would export it
    for language, text in blocks(page):
        if language == "toml":
            name = re.search(r'^name = "(.*)"', text, re.MULTILINE)
            assert name is not None
            Path(f"{name.group(1)}.toml").write_text(text, encoding="utf-8")
        elif language == "sh":
            for line in text.replace("\\\n", "").strip().splitlines():
                capsys.readouterr()
                run_line(line)
        elif language == "text":
            printed = capsys.readouterr().out
            assert is_printed(text, printed), f"{page.name} shows\n{text}\nwhere this is printed:\n{printed}"
        elif file := re.match(r"(?:# |/\* )(\w+\.(?:py|c))\b", text):
            Path(file.group(1)).write_text(text, encoding="utf-8")
        else:
            capsys.readouterr()
            exec(compile(text, page.name, "exec"), {})


def test_readme_shows_the_table_that_validate_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    readme = [line.split() for line in (ROOT / "README.md").read_text(encoding="utf-8").splitlines()]
    assert main(["validate", "settled-trajectory", "--keep", "none"]) == 0
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    headings = [row for row in printed if row[:1] == ["scenario"]]
    (judged,) = [row for row in printed if row[:1] == ["settled-trajectory"]]
    assert judged in readme
    assert headings[0] in readme


@pytest.mark.parametrize(
    ("shown", "expected"),
    [
        ("load [m]  agree\n1.8e-09     yes\n", True),
        ("load [m]  agree\n2.2e-03     yes\n", False),
        ("load [m]  agree\n", False),
        ("load [m]  …\n…e-09     yes\n", True),
        ("…\n1.8e-09     yes\n…\n", True),
        ("…\n1.9e-09     yes\n…\n", False),
        ("load …     yes\n", False),
    ],
)
def test_an_output_that_is_not_printed_is_seen(shown: str, expected: bool) -> None:
    assert is_printed(shown, "load [m]  agree  \n1.8e-09     yes\n") == expected


@pytest.mark.parametrize("page", ALL_PAGES, ids=lambda page: page.name)
def test_a_page_can_be_read(page: Path) -> None:
    """A screen reader reads headings of columns and descriptions of pictures."""
    text = page.read_text(encoding="utf-8")
    headings = re.findall(r"^\|(.*)\|\n\|[-|: ]+\|$", text, re.MULTILINE)
    assert [row for row in headings if any(not cell.strip() for cell in row.split("|"))] == []
    descriptions = re.findall(r"!\[(.*?)\]", text, re.DOTALL)
    assert [words for words in descriptions if len(words.split()) < 5] == []
    other = r"^```.*?^```|^<!-- written by.*?^<!-- end -->"
    prose = re.sub(other, "", text, flags=re.MULTILINE | re.DOTALL)
    long = [line for line in prose.splitlines() if len(line) > 100]
    if page.name != "CHANGELOG.md":
        assert [line for line in long if not re.match(r"\s*(\||    |<|!?\[|- \[)", line)] == []
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        assert target.startswith("http") or (page.parent / target).exists(), target
    assert broken_anchors(page) == []


def test_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 90


def anchors(text: str) -> set[str]:
    """Return the anchors of a page's headings, as GitHub and MyST make them."""
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    found: set[str] = set()
    for heading in re.findall(r"^#{1,4} +(.*?) *$", prose, re.MULTILINE):  # to the level of docs/conf.py
        title = re.sub(r"\[(.*?)\]\(.*?\)|[*`]", r"\1", heading)
        slug = re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")
        found.add(next(s for k in count() if (s := f"{slug}-{k}" if k else slug) not in found))
    return found


def broken_anchors(page: Path) -> list[str]:
    """Return the links of a page, `other.md#anchor` or `#anchor`, without a heading."""
    links = re.findall(r"\]\((?!http)([^)#]*)#([^)]+)\)", page.read_text(encoding="utf-8"))
    targets = {file: (page.parent / file if file else page) for file, _ in links}
    known = {file: anchors(path.read_text(encoding="utf-8")) for file, path in targets.items()}
    return [f"{file}#{anchor}" for file, anchor in links if anchor not in known[file]]


def test_a_link_without_its_heading_is_seen(tmp_path: Path) -> None:
    (tmp_path / "other.md").write_text("## Read `a.toml`, [then](x.md) run_it!\n\n## Again\n\n## Again\n")
    page = tmp_path / "page.md"
    good = "[a](other.md#read-atoml-then-run_it) [b](other.md#again) [c](other.md#again-1) [d](#here)\n"
    page.write_text(f"# Here\n\n```sh\n# No heading\n```\n\n{good}")
    assert broken_anchors(page) == []
    page.write_text(f"# Here\n\n```sh\n# No heading\n```\n\n[e](#no-heading) [f](other.md#again-2) {good}")
    assert broken_anchors(page) == ["#no-heading", "other.md#again-2"]


def test_every_test_that_the_page_of_promises_names_exists() -> None:
    page = (ROOT / "docs" / "proofs" / "reliability.md").read_text(encoding="utf-8")
    named = re.findall(r"`(?:tests/)?([\w/]+\.py)::(\w+)`", page)
    assert len(named) > 50
    for file, name in named:
        text = (ROOT / "tests" / file).read_text(encoding="utf-8")
        assert re.search(rf"^def {name}\(", text, re.MULTILINE), f"{file}::{name}"


def test_no_recipe_opens_a_scheduler_to_everybody(capsys: pytest.CaptureFixture[str]) -> None:
    """Everybody who reaches a scheduler can run programs, and by default it listens on all addresses."""
    recipes = []
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        text = page.read_text()
        commands = re.findall("^dask (?:scheduler|worker) .*$", text, re.MULTILINE)
        assert not commands or ("runs programs on it" in text and "tls://" in text)
        recipes += commands
    assert recipes
    assert all(re.search(r" --host 10[.\d]+ ", recipe) for recipe in recipes)
    assert main(["campaign", "run", "--help"]) == 0
    help_text = " ".join(capsys.readouterr().out.split())
    assert "Whoever reaches it runs programs there: start it with --host" in help_text
