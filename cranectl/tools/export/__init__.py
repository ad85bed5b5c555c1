"""Export controllers as C99 and FMUs, and plants as FMUs; load controllers from FMUs and other processes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
