"""Design controllers of the flat family: state feedback of each axis on z'''' = v, with its margins."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
