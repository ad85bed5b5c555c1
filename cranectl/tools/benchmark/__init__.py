"""The benchmark: every controller runs the same campaigns on scenarios, sets of cranes and plants."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
