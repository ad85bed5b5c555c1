"""Close the files that tests of controllers open."""

from tests.loaders.conftest import forgotten

__all__ = ["forgotten"]
