"""Measured cranes: import their logs, check them against physics, and predict them with the plants."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
