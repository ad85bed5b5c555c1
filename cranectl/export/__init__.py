"""Export controllers as C99, translated from the compiled functions themselves."""

from cranectl.export.package import exported_files

__all__ = ["exported_files"]
