"""Pictures and videos of runs, drawn by MuJoCo's renderer without a screen."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
