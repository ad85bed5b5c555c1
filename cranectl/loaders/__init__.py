"""Open controllers from outside the package, and load those in Python files and C libraries."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
