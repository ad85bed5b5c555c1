"""Fixtures of tests of exports."""

from tests.loaders.conftest import forgotten, law

__all__ = ["forgotten", "law"]
