"""Every remedy in the sources is tested, or `other_remedies.toml` gives the reason why not."""

import ast
import re
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import click

from cranectl.cli.main import cli
from tests.cli import option_cases
from tests.conftest import ROOT
from tests.remedies import Remedy, remedies_in, without_remedy
from tests.syntax import PACKAGE, trees_in

INPUTS = ("campaign", "controllers", "design", "files", "planning", "reference", "rules", "scenario")
TABLES = [option_cases, *(import_module(f"tests.cli.test_key_remedies_{name}") for name in INPUTS)]
TESTED: set[Remedy] = {
    (source, case.remedy) for table in TABLES for source, cases in table.CASES.items() for case in cases
}
OTHERS: dict[str, dict[str, list[str]]] = tomllib.loads(
    Path(__file__).with_name("other_remedies.toml").read_text(encoding="utf-8")
)
LISTED: list[Remedy] = [
    (source, text) for sources in OTHERS.values() for source, texts in sources.items() for text in texts
]
# Options of other programs and of pytest, and names in style sheets.
OTHER_OPTIONS = {
    "--nworkers", "--nthreads", "--include-metadata", "--include-attachments", "--cranectl-update",
    "--cranectl-logs", "--traceback", "--text", "--wide", "--block", "--forbidden", "--junitxml",
}  # fmt: skip
SOURCE = """
OUTSIDE = "go outside"
REMEDIES = {"late": "come earlier"}

def leaves(name: str) -> str:
    return f"leave '{name}' out" if name else "leave"

def check(kind: str, *, remedy: str = "by default") -> None:
    remedy = "given by a variable"
    raise InputError("found", allowed="allowed", remedy=leaves(kind) or OUTSIDE + " now")

def bare() -> None:
    raise InputError("found", allowed="allowed")
"""


def test_every_remedy_is_tested_or_listed() -> None:
    known = remedies_in()
    assert known - TESTED - set(LISTED) == set(), "neither tested nor in other_remedies.toml"
    assert (TESTED | set(LISTED)) - known == set(), "no longer in the sources"
    assert TESTED & set(LISTED) == set(), "both listed and tested"
    assert len(LISTED) == len(set(LISTED)), "listed twice"


def test_tests_that_the_list_names_exist() -> None:
    files = [reason.split()[-1] for reason in OTHERS if "tests/" in reason]
    assert files
    assert [file for file in files if not (ROOT / file).is_file()] == []


def test_every_error_about_input_has_a_remedy() -> None:
    assert without_remedy() == []


def test_validators_raise_errors_with_a_remedy() -> None:
    """Validators of settings raise `RuleError`, which has a remedy, and no `ValueError`."""
    validators = [
        path for path in PACKAGE.rglob("*.py") if "@model_validator" in path.read_text(encoding="utf-8")
    ]
    assert len(validators) > 8
    assert [path.name for path in validators if "raise ValueError" in path.read_text(encoding="utf-8")] == []


def test_the_inventory_finds_remedies_of_every_form(tmp_path: Path) -> None:
    (tmp_path / "module.py").write_text(SOURCE)
    texts = ["come earlier", "leave '{}' out", "leave", "go outside now", "by default", "given by a variable"]
    assert remedies_in(tmp_path) == {("module.py", text) for text in texts}
    assert without_remedy(tmp_path) == ["module.py:13"]


def options(command: click.Command) -> Iterator[str]:
    yield from command.get_help_option_names(click.Context(command))
    yield from (name for parameter in command.params for name in parameter.opts)
    for subcommand in command.commands.values() if isinstance(command, click.Group) else ():
        yield from options(subcommand)


def test_every_command_and_option_that_a_text_names_exists() -> None:
    trees = trees_in().values()
    texts = [str(node.value) for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    named = {name for text in texts for name in re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z]", text)}
    assert named - {*options(cli)} == OTHER_OPTIONS
    groups = {name: command for name, command in cli.commands.items() if isinstance(command, click.Group)}
    pairs = re.findall(rf"cranectl ({'|'.join(groups)}) ([a-z]+)", "\n".join(texts))
    assert len(pairs) > 20
    assert [pair for pair in pairs if pair[1] not in groups[pair[0]].commands] == []
