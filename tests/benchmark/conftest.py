"""Laws that a test opens are closed after it: schemas and lists know all that is open."""

from collections.abc import Iterator

import pytest

from cranectl.loaders.opening import close_controllers


@pytest.fixture(autouse=True)
def laws_closed() -> Iterator[None]:
    yield
    close_controllers()
