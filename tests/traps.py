"""Files of a working directory that carry the names of modules and must never be run."""

import textwrap
from pathlib import Path

NAMES = ("ctypes", "logging", "multiprocessing", "mujoco", "numpy", "pickle", "signal", "socket", "struct")


def set_traps(folder: Path) -> Path:
    """Put modules into `folder` that write their name into a file when they are run; return that file."""
    sprung = folder / "sprung.txt"
    sprung.touch()
    for name in NAMES:
        (folder / f"{name}.py").write_text(
            textwrap.dedent(f"""
                with open({str(sprung)!r}, "a") as file:
                    file.write("{name} ")
                raise SystemExit(1)
            """)
        )
    return sprung
