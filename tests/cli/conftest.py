"""What tests of several commands share."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.loaders.opening import close_controllers


@pytest.fixture
def in_copy(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Run the test in a copy of `made`, a directory of its module; close the controllers that it opens."""
    shutil.copytree(made, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    yield
    close_controllers()
