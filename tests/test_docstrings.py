"""The docstrings of the public API are complete in NumPy style, and their examples run."""

import doctest
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from numpydoc.validate import validate

import cranectl

# Checks of numpydoc that need not pass: an extended summary, links to other objects, an example.
OPTIONAL = {"ES01", "SA01", "EX01"}
NOT_OBJECTS = {"CONTROLLERS"}  # a tuple, which is documented in its module
TABLES = {  # docs/reference/settings.md and status.py document their fields
    "RigParameters",
    "Scenario",
    "RunStatus",
}
MADE_BY_FUNCTIONS = {"OpenRun", "OpenRuns"}  # which document the parameters


def faults(name: str) -> list[str]:
    """Return the errors that numpydoc reports for a docstring."""
    optional = OPTIONAL | {"PR01"} if name.rpartition(".")[2] in TABLES | MADE_BY_FUNCTIONS else OPTIONAL
    return [f"{code}: {text}" for code, text in validate(name)["errors"] if code not in optional]


@pytest.mark.parametrize("name", sorted(set(cranectl.__all__) - NOT_OBJECTS))
def test_a_public_docstring_is_complete(name: str) -> None:
    assert faults(f"cranectl.{name}") == []


def test_a_docstring_without_parameters_is_refused() -> None:
    assert faults("tests.test_docstrings.faults") == [
        "PR01: Parameters {'name'} not documented",
        "RT01: No Returns section found",
    ]


def modules() -> Iterator[str]:
    for name in sorted(set(cranectl.__all__) - NOT_OBJECTS):
        yield getattr(cranectl, name).__module__


@pytest.mark.parametrize("module", sorted(set(modules())))
def test_examples_of_docstrings_run(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = doctest.testmod(importlib.import_module(module), optionflags=doctest.ELLIPSIS)
    assert result.failed == 0
