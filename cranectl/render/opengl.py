"""OpenGL without a screen: which of MuJoCo's backends works here."""

import contextlib
import functools
import importlib
import os
import sys
import warnings
from collections.abc import Iterator
from typing import Any

from cranectl.support.children import answer_of_program
from cranectl.support.errors import InputError

HEADLESS = ("egl", "osmesa")
DRAWING = (*HEADLESS, "glfw", "cgl")
PROBE = """
import mujoco
from mujoco.{0} import GLContext
context = GLContext(16, 16)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
"""
PROBE_TIME = 60.0  # [s]


def check_engine() -> None:
    """Raise InputError if MuJoCo refuses MUJOCO_GL: it looks for the backend when it is imported."""
    try:
        import mujoco  # noqa: F401
    except Exception as error:
        raise no_opengl({os.environ.get("MUJOCO_GL", ""): _reason(str(error))}) from None


@contextlib.contextmanager
def drawing(model: Any, width: int, height: int) -> Iterator[Any]:
    """Yield MuJoCo's drawing context of a model, current until the end; raise InputError without OpenGL."""
    import mujoco

    backend, failures = _chosen()
    opened = contextlib.ExitStack()
    try:
        with warnings.catch_warnings(action="ignore"):  # glfw warns of what its error says too
            screen = importlib.import_module(f"mujoco.{backend}").GLContext(width, height)
            opened.callback(screen.free)
            screen.make_current()
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        opened.callback(context.free)
    # Whatever is missing, PyOpenGL and the drivers say so by anything from ImportError to AttributeError.
    except Exception as error:
        opened.close()
        raise no_opengl({**failures, backend: _reason(str(error))}) from None
    with opened:
        yield context


def no_opengl(tried: dict[str, str]) -> InputError:
    """Return the error for backends that do not work, by name with the reason."""
    reasons = "; ".join(f"MUJOCO_GL={backend}: {reason}" for backend, reason in tried.items())
    return InputError(
        f"no OpenGL to draw with. Tried {reasons}",
        allowed="MUJOCO_GL unset, egl or osmesa, in software if need be; glfw with a screen",
        remedy="install one, on Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri, or libosmesa6",
    )


@functools.cache
def _chosen() -> tuple[str, dict[str, str]]:
    """Return the backend of MUJOCO_GL or the first that works without a screen, and why others fail."""
    named = os.environ.get("MUJOCO_GL", "").lower().strip()
    if named in DRAWING:
        return named, {}
    if named:
        raise no_opengl({named: "this does not draw"})
    if not sys.platform.startswith("linux"):
        return "cgl" if sys.platform == "darwin" else "glfw", {}
    failure = _failure(HEADLESS[0])
    return (HEADLESS[1], {HEADLESS[0]: failure}) if failure else (HEADLESS[0], {})


def _failure(backend: str) -> str:
    """Return why a backend does not work, or "", tried in its own process, as a failure bars all others."""
    # -P: no module of the working directory, but those of PYTHONPATH as in this process.
    command = [sys.executable, "-P", "-c", PROBE.format(backend)]
    environment = {**os.environ, "MUJOCO_GL": backend}
    try:
        code, _, errors = answer_of_program(command, PROBE_TIME, environment=environment)
    except TimeoutError:
        return "it hangs"
    return _reason(errors or "it crashes") if code else ""


def _reason(text: str) -> str:
    """Return the last line of `text`, shortened."""
    last = (text.strip().splitlines() or ["no reason given"])[-1]
    if "'NoneType' object has no attribute" in last:  # all that PyOpenGL says of a library it has not found
        return "its library is missing"
    return last if len(last) <= 120 else last[:117] + "..."
