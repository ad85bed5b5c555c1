"""Write, read and describe logs: one MCAP file for a run, or for the runs of several plants."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
