"""The syntax of source files, which many tests read: parsed once per process."""

import ast
import functools
from pathlib import Path

from tests.conftest import ROOT

PACKAGE = ROOT / "cranectl"


@functools.cache
def trees_in(folder: Path = PACKAGE) -> dict[Path, ast.Module]:
    """Return the syntax of the sources below a folder, by their paths in order."""
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(folder.rglob("*.py"))}
