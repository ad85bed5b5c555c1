"""Close controllers after each test, because schemas and lists contain all open controllers."""

from collections.abc import Iterator

import pytest

from cranectl.loaders.opening import close_controllers


@pytest.fixture(autouse=True)
def close_opened_controllers() -> Iterator[None]:
    yield
    close_controllers()
