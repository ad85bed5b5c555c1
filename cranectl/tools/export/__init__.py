"""Export controllers as C99, translated from the compiled functions themselves, and with plants as FMUs."""

from cranectl.tools.export.controller_fmu import controller_fmu
from cranectl.tools.export.package import exported_files
from cranectl.tools.export.prepared import prepare_export

__all__ = ["controller_fmu", "exported_files", "prepare_export"]
