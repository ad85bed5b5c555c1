"""Read MCAP files, whole, damaged or cut off, as columns of messages; nothing here is about cranes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
