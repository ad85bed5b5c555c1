"""Record which files of the project a run of tests reads.

`.ci/proven.py` runs a slow set of tests only if a file that it depends on has changed. It lists these files,
and no test of the set may read any other file.
"""

import os
import re
import sys
from pathlib import Path
from typing import Any

LISTED = os.environ.get("PROVEN_FILES")
ROOT = Path(__file__).parents[1]
FOLDERS = ("cranectl", "docs", "examples", "models", "tests", "validation", "viewer")
TRACKED = tuple(f"{ROOT / folder}{os.sep}" for folder in FOLDERS)
GENERATED = re.compile(r"__pycache__|/viewer/(node_modules|failures)/")
PLUGIN = {"cranectl/cli/pytest_plugin.py", "cranectl/cli/__init__.py"}  # every session of pytest loads it
DIGEST = "fingerprint"  # this function reads all sources, but tests do not depend on its result

_opened: set[str] = set()


def watch() -> None:
    """Record from now on which data files are opened; an audit hook cannot be removed."""
    sys.addaudithook(_record)


def unlisted() -> set[str]:
    """Return the imported modules and the opened files that are not in the list."""
    modules = {
        str(module.__file__) for module in [*sys.modules.values()] if getattr(module, "__file__", None)
    }
    ours = {path for path in modules | _opened if path.startswith(TRACKED)}
    names = {Path(path).relative_to(ROOT).as_posix() for path in ours}
    return names - PLUGIN - set(Path(str(LISTED)).read_text(encoding="utf-8").splitlines())


def _record(event: str, arguments: tuple[Any, ...]) -> None:
    if event != "open" or not isinstance(arguments[0], str) or not arguments[0].startswith(TRACKED):
        return
    path = os.path.normpath(arguments[0])  # `validation/../../elsewhere` is no file of the project
    is_generated = GENERATED.search(path) is not None
    is_source = path.endswith(".py")  # imported modules are in sys.modules
    is_read_only = set(arguments[1] or "").isdisjoint("wax+")
    if not is_generated and not is_source and is_read_only and not _is_digested():
        _opened.add(path)


def _is_digested() -> bool:
    frame = sys._getframe()
    while frame := frame.f_back:  # type: ignore[assignment]
        if frame.f_code.co_name == DIGEST:
            return True
    return False
