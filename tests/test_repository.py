"""The repository has few make targets, the same ones in every CI system, and valid hooks."""

import re
import shlex
import subprocess
import tomllib

import pytest
import yaml

from cranectl.cli.main import main
from tests.conftest import ROOT

MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = dict(re.findall(r"^([a-z-]+):(?:.*?## (.*))?$", MAKEFILE, re.MULTILINE))
WORKFLOW = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))


def targets_of(command: str) -> list[str]:
    """Return the targets of a command line that begins with `make`."""
    words = shlex.split(command, comments=True)
    return [word for word in words[1:] if word in TARGETS] if words[:1] == ["make"] else []


def test_there_are_few_targets_with_a_line_of_help_each() -> None:
    assert len(TARGETS) <= 16
    assert all(TARGETS.values()), TARGETS
    assert max(map(len, TARGETS.values())) <= 80


def test_every_target_is_declared_phony() -> None:
    (declared,) = re.findall(r"^\.PHONY:((?:.*\\\n)*.*)$", MAKEFILE, re.MULTILINE)
    assert set(declared.replace("\\", " ").split()) == set(TARGETS)


def test_both_ci_systems_call_the_same_targets_in_the_same_order() -> None:
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    own = [target for line in lines for target in targets_of(line)]
    job = WORKFLOW["jobs"]["test"]
    assert [step["run"] for step in job["steps"] if "run" in step] == ["make ${{ matrix.target }}"]
    assert own == job["strategy"]["matrix"]["target"]
    assert len(own) >= 8


def test_ci_uses_the_oldest_and_the_newest_python() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = [
        re.fullmatch(r"Programming Language :: Python :: (3\.\d+)", text) for text in project["classifiers"]
    ]
    versions = sorted((match[1] for match in named if match), key=lambda text: int(text.split(".")[1]))
    assert WORKFLOW["jobs"]["test"]["strategy"]["matrix"]["python"] == [versions[0], versions[-1]]
    assert project["requires-python"] == f">={versions[0]}"


def test_hooks_run_what_lint_runs() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0][
        "hooks"
    ]
    assert {hook["language"] for hook in hooks} == {"system"}
    recipe = re.search(r"^lint:.*\n((?:\t.*\n)+)", MAKEFILE, re.MULTILINE)
    assert recipe is not None
    tools = [re.sub(r" --\S+", "", hook["entry"]).replace(".venv/bin/", "") for hook in hooks]
    assert tools == ["ruff format", "ruff check", "typos", "lint-imports", "make lint"]
    assert all(tool in recipe[1] for tool in tools[:-1])


def test_the_folder_of_logs_says_what_lands_there(capsys: pytest.CaptureFixture[str]) -> None:
    """Git keeps its page alone; each name in the table is the default that the command's help states."""
    tracked = subprocess.run(
        ["git", "ls-files", "logs"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert tracked.stdout.split() == ["logs/README.md"]
    subprocess.run(
        ["git", "check-ignore", "--quiet", "logs/fixed-position/lqr-ideal.mcap"], cwd=ROOT, check=True
    )
    table = (ROOT / "logs" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([^`.]+(?:\.mcap)?)`[^|]*\| `cranectl ([^`]+)`", table, re.MULTILINE)
    for name, command in rows:
        assert main([*command.split(), "--help"]) == 0
        shown = "".join(capsys.readouterr().out.split())  # lines break at hyphens
        assert f"logs/{name}" in shown, command
    assert len(rows) == 8


@pytest.mark.parametrize(
    "page",
    [
        "README.md",
        "CONTRIBUTING.md",
        *(f"docs/{path.relative_to(ROOT / 'docs')}" for path in sorted((ROOT / "docs").rglob("*.md"))),
    ],
)
def test_every_target_that_a_page_names_exists(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    named = re.findall(r"(?:`|^    )make ([a-z][a-z-]*)", text, re.MULTILINE)
    assert set(named) <= set(TARGETS)


def test_one_file_pins_all_direct_dependencies() -> None:
    configuration = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = configuration["project"]
    lists = [project["dependencies"], *project["optional-dependencies"].values()]
    lists += configuration["dependency-groups"].values()
    pins = [line.split("==")[0] for line in (ROOT / "constraints.txt").read_text().splitlines()]
    pinned = [re.sub(r"[-_.]+", "-", name).lower() for name in pins]
    required = {
        re.sub(r"[-_.]+", "-", name[0]).lower()
        for group in lists
        for text in group
        if (name := re.match(r"[\w.-]+", text))
    }
    assert len(pinned) == len(set(pinned))
    assert required - {project["name"]} <= set(pinned)
    assert len(required) > 30
