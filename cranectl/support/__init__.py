"""Provide general tools that know nothing of cranes: errors, files, text, compiled code, interrupts."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
