"""Run cases of one scenario, controller and drive on several plants, judge them, and run many at once."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
