"""Compare runs: plants with each other, runs with golden logs, and the limits of their differences."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
