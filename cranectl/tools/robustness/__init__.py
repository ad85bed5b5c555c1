"""Measure and certify the effect of the differences between a rig and its design model."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
