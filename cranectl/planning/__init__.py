"""Plan motions in minimum time within limits that are proven to hold at all times."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
