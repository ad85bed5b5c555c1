"""Our rigid equations: the crane as a Lagrange system, and its flatness."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
