"""Files in the working directory with the names of modules; cranectl must never import them."""

import textwrap
from pathlib import Path

NAMES = ("ctypes", "logging", "multiprocessing", "mujoco", "numpy", "pickle", "signal", "socket", "struct")


def write_shadowing_modules(folder: Path) -> Path:
    """Write modules that append their name to a file when they are imported; return that file."""
    imported = folder / "imported_modules.txt"
    imported.touch()
    for name in NAMES:
        (folder / f"{name}.py").write_text(
            textwrap.dedent(f"""
                with open({str(imported)!r}, "a") as file:
                    file.write("{name} ")
                raise SystemExit(1)
            """)
        )
    return imported
