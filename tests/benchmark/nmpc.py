"""Build the library of `nmpc` by the command in its first comment."""

import subprocess
from pathlib import Path

from cranectl.loaders.c_controller import HEADER
from tests.conftest import ROOT
from tests.pace import HANG

FOLDER = ROOT / "validation" / "benchmark" / "nmpc"


def build_library(folder: Path) -> Path:
    """Build the library in `folder`, and return its path."""
    library = folder / "nmpc.so"
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror", "-shared", "-fPIC"]
    flags += ["-ffp-contract=off", f"-I{HEADER.parent}"]
    subprocess.run(
        ["cc", *flags, "-o", library, FOLDER / "nmpc.c", FOLDER / "model.c", "-lm"], check=True, timeout=HANG
    )
    return library
