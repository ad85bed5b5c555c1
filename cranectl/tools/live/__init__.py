"""Run a session that a user watches and steers live: commands, server and recording."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
