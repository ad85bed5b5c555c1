"""OpenGL without a screen: find a backend of MuJoCo that works."""

import contextlib
import functools
import importlib
import os
import sys
import warnings
from collections.abc import Iterator
from typing import Any

from cranectl import plants
from cranectl.support import InputError, Program, SafePath

HEADLESS = ("egl", "osmesa")
BACKENDS = (*HEADLESS, "glfw", "cgl")
PROBE_CODE = """
import mujoco
from mujoco.{0} import GLContext
context = GLContext(16, 16)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
"""
PROBE_TIMEOUT = 60.0  # [s]


def check_engine() -> None:
    """Raise InputError if MuJoCo refuses MUJOCO_GL, which it checks when it is imported."""
    try:
        _ = plants.DrawnRig  # loads the engine; an import of the name would hide the engine's own error
    except Exception as error:
        raise no_opengl({os.environ.get("MUJOCO_GL", ""): _last_line(str(error))}) from None


@contextlib.contextmanager
def drawing_context(model: Any, width: int, height: int) -> Iterator[Any]:
    """Yield MuJoCo's drawing context of a model, current until the end; raise InputError without OpenGL."""
    import mujoco

    backend, failures = _choose_backend()
    opened = contextlib.ExitStack()
    try:
        with warnings.catch_warnings(action="ignore"):  # glfw warns and raises for the same reason
            screen = importlib.import_module(f"mujoco.{backend}").GLContext(width, height)
            opened.callback(screen.free)
            screen.make_current()
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        opened.callback(context.free)
    # If anything is missing, PyOpenGL and drivers raise anything from ImportError to AttributeError.
    except Exception as error:
        opened.close()
        raise no_opengl({**failures, backend: _last_line(str(error))}) from None
    with opened:
        yield context


def no_opengl(failures: dict[str, str]) -> InputError:
    """Return the error for backends that do not work, from reasons by name."""
    reasons = "; ".join(f"MUJOCO_GL={backend}: {reason}" for backend, reason in failures.items())
    return InputError(
        f"no OpenGL to draw with. Tried {reasons}",
        allowed="MUJOCO_GL unset, egl or osmesa, in software if need be; glfw with a screen",
        remedy="install one, on Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri, or libosmesa6",
    )


@functools.cache
def _choose_backend() -> tuple[str, dict[str, str]]:
    """Return the backend of MUJOCO_GL or the first that works without a screen, and failures of others."""
    requested = os.environ.get("MUJOCO_GL", "").lower().strip()
    if requested in BACKENDS:
        return requested, {}
    if requested:
        raise no_opengl({requested: "this does not draw"})
    if not sys.platform.startswith("linux"):
        return "cgl" if sys.platform == "darwin" else "glfw", {}
    failure = _probe_backend(HEADLESS[0])
    return (HEADLESS[1], {HEADLESS[0]: failure}) if failure else (HEADLESS[0], {})


def _probe_backend(backend: str) -> str:
    """Return why a backend does not work, or ""; a child process tries it, since a failure is permanent."""
    # -P: import no module of the working directory, but those of PYTHONPATH as in this process.
    command = [sys.executable, "-P", "-c", PROBE_CODE.format(backend)]
    try:
        with SafePath():
            environment = {**os.environ, "MUJOCO_GL": backend}
            code, _, errors = Program.ask(command, PROBE_TIMEOUT, environment=environment)
    except TimeoutError:
        return "it hangs"
    return _last_line(errors or "it crashes") if code else ""


def _last_line(text: str) -> str:
    """Return the last line of `text`, shortened."""
    last = (text.strip().splitlines() or ["no reason given"])[-1]
    if "'NoneType' object has no attribute" in last:  # PyOpenGL's only message about a missing library
        return "its library is missing"
    return last if len(last) <= 120 else last[:117] + "..."
