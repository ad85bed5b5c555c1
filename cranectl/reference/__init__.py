"""The load's reference: time laws, paths and trajectories, computed, read from files or driven by hand."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
