"""Close controllers after each test, because schemas and lists contain all open ones."""

from collections.abc import Iterator

import pytest

from cranectl.loaders.opening import close_controllers


@pytest.fixture(autouse=True)
def laws_closed() -> Iterator[None]:
    yield
    close_controllers()
