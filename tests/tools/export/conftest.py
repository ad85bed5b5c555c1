"""Fixtures of tests of exports."""

from tests.loaders.conftest import forgotten

__all__ = ["forgotten"]
