"""A fixture for tests that run commands on prepared files."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.loaders.opening import close_controllers


@pytest.fixture
def in_copy_of_files(prepared_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Run the test in a copy of the module's directory `prepared_files`, and close opened controllers."""
    shutil.copytree(prepared_files, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    yield
    close_controllers()
