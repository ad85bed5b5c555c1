"""The workflow that `cranectl new workflow` writes: it tests what a repository has of cranes on GitHub."""

import shlex
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from cranectl.cli.info_settings import kind_of
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.support import TOML, InputError

TEMPLATE = Path(__file__).parent / "templates" / "workflow.yml.txt"
OTHERS = ("logs", "build", "dist", "node_modules")  # folders that hold no sources
MAX_FAILURES = "5%"  # of a campaign, to begin with
PIP_CACHE = "          cache: pip\n          cache-dependency-path: pyproject.toml\n"  # only with that file
# A report is wanted most when what it reports has failed.
ALSO_AFTER_FAILURE = "        if: ${{ !cancelled() && steps.installed.outcome == 'success' }}\n"
UPLOAD = """\
      - uses: actions/upload-artifact@v4 # pages, tests, and logs of what failed, to be opened in Foxglove
        if: always()
        with:
          name: results
          path: |
"""


class Repository(NamedTuple):
    """What a folder has that a workflow tests."""

    tests: list[Path]
    scenarios: list[str]  # files, or folders that hold nothing else
    campaigns: list[Path]
    trusting: set[str]  # kinds of files of which one names a controller's file: its code runs with --trust
    project: dict[str, Any]  # the table [project] of pyproject.toml; empty without one
    is_package: bool  # whether there is a pyproject.toml

    @staticmethod
    def read(folder: Path) -> "Repository":
        """Return what `folder` and its folders hold; raise InputError if nothing can be tested."""
        files = [*_sources(folder)] if folder.is_dir() else []
        tables = [path for path in files if path.suffix == ".toml" and path.name != "pyproject.toml"]
        kinds = {path.relative_to(folder): _kind(path) for path in tables}
        file = folder / "pyproject.toml"
        found = Repository(
            tests=[path for path in files if path.match("test_*.py")],
            scenarios=[*_grouped(kinds)],
            campaigns=[path for path, kind in kinds.items() if kind == "campaign"],
            trusting={kind for path, kind in kinds.items() if kind and _names_code(folder / path)},
            project=TOML.read(file).get("project", {}) if file.is_file() else {},
            is_package=file.is_file(),
        )
        if not (found.tests or found.scenarios or found.campaigns):
            raise InputError(
                f"no test, scenario or campaign in {folder.resolve()}",
                allowed="a folder with something that a workflow can test",
                remedy="begin with one: cranectl new scenario first-move",
            )
        return found

    @property
    def installed(self) -> str:
        """What pip installs, as arguments."""
        has_extra = "test" in self.project.get("optional-dependencies", {})
        own = '".[test]"' if has_extra else ". pytest" if self.is_package else "pytest"
        return f'"$CRANECTL" {own}'

    def _trust(self, kind: str) -> list[str]:
        return ["--trust"] if kind in self.trusting else []

    def steps(self) -> Iterator[tuple[list[str], list[str]]]:
        """Yield commands of the steps, in lines, and what they write."""
        if self.tests:
            yield ["python -m pytest --junitxml tests.xml --cranectl-logs logs"], ["tests.xml"]
        if self.scenarios:
            own = self.project.get("entry-points", {}).get("cranectl.controllers", {})
            options = [f"--controller {shlex.quote(name)}" for name in own]
            options += self._trust("scenario") if not own else []
            yield (
                [
                    " ".join(["cranectl validate", *self.scenarios, *options, "--keep failed"]),
                    "--junit validation.xml --report validation.html",
                ],
                ["validation.xml", "validation.html"],
            )
        for campaign in self.campaigns:
            logs, results = shlex.quote(f"logs/{campaign.stem}"), shlex.quote(campaign.stem)
            run = f"cranectl campaign run {shlex.quote(campaign.as_posix())}"
            yield (
                [
                    " ".join([run, *self._trust("campaign"), f"--out {logs}"]),
                    f"--max-failures {MAX_FAILURES} --junit {results}.xml",
                ],
                [f"{campaign.stem}.xml"],
            )
            yield [f"cranectl campaign report {logs} --out {results}.html"], [f"{campaign.stem}.html"]


def workflow_text(name: str, folder: Path) -> str:
    """Return a workflow of GitHub for what `folder` has; raise InputError if nothing can be tested."""
    repository = Repository.read(folder)
    text = TEMPLATE.read_text(encoding="utf-8").replace("NAME", name, 1)
    text = text.replace("PIP_CACHE\n", PIP_CACHE if repository.is_package else "")
    text = text.replace("INSTALLED", repository.installed)
    written = []
    for lines, files in repository.steps():
        text += f"      - run: {lines[0]}\n" if len(lines) == 1 else "      - run: >-\n"
        text += "".join(f"          {line}\n" for line in lines if len(lines) > 1)
        text += ALSO_AFTER_FAILURE
        written += files
    return text + UPLOAD + "".join(f"            {path}\n" for path in [*written, "logs/"])


def _sources(folder: Path) -> Iterator[Path]:
    """Yield the files in a folder and below, without hidden folders, results and environments of Python."""
    for path in sorted(folder.iterdir()):
        is_source = not path.name.startswith(".") and path.name not in OTHERS
        if path.is_file():
            yield path
        elif is_source and path.is_dir() and not path.is_symlink() and not (path / "pyvenv.cfg").exists():
            yield from _sources(path)


def _kind(path: Path) -> str:
    """Return "scenario", "campaign", or "" for another table."""
    try:
        if "scenario" in TOML.read(path):  # a key that only campaigns have
            return "campaign"
        return "scenario" if kind_of(path) == "scenario" else ""
    except InputError:  # another kind, or no TOML
        return ""


def _names_code(path: Path) -> bool:
    """Return True if a scenario or campaign names the file of a controller."""
    table = TOML.read(path)
    controller = table.get("controller", "")
    names = [controller.get("name") if isinstance(controller, dict) else controller]
    names += table["controllers"] if isinstance(table.get("controllers"), list) else []
    return any(isinstance(name, str) and ALL_CONTROLLERS.is_reference(name) for name in names)


def _grouped(kinds: dict[Path, str]) -> Iterator[str]:
    """Yield the scenarios as arguments of `validate`: folders that have nothing else, and files."""
    for parent, group in groupby(kinds, key=lambda path: path.parent):
        paths = [*group]
        scenarios = [path for path in paths if kinds[path] == "scenario"]
        if scenarios == paths and parent != Path():
            yield shlex.quote(parent.as_posix())
        else:
            yield from (shlex.quote(path.as_posix()) for path in scenarios)
