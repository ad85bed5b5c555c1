"""What tests of controllers from files share."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.loaders.opening import close_controllers
from tests.loaders.controller_files import LAW


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    """Close the files that a test has opened."""
    yield
    close_controllers()


@pytest.fixture
def law(tmp_path: Path) -> Path:
    """Return a file with controllers in Python."""
    path = tmp_path / "law.py"
    path.write_text(LAW)
    return path
