"""Machines without OpenGL, or with some that does not work: each in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cranectl.log.writer import write_log
from cranectl.scenario import Scenario
from cranectl.simulate import simulate_run
from tests.shadowing_modules import write_shadowing_modules

DRAW = """
from cranectl.support.errors import InputError
from cranectl.tools.render.opengl import check_engine, drawing_context
try:
    check_engine()
    import mujoco
    with drawing_context(mujoco.MjModel.from_xml_string("<mujoco/>"), 16, 16) as context:
        print("drawn")
except InputError as error:
    print(error)
"""
EGL, OSMESA = ("libEGL.so", "libEGL.so.1"), ("libOSMesa.so", "libOSMesa.so.6", "libOSMesa.so.8")


def elsewhere(command: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    """A process whose OpenGL is as told."""
    inherited = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    environment = {**inherited, "DISPLAY": "", **environment}
    command = [sys.executable, *command]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def hidden(folder: Path, *libraries: str) -> str:
    """A directory to look for libraries in, where these are no libraries."""
    for library in libraries:
        (folder / library).touch()
    return str(folder)


@pytest.mark.parametrize(
    ("named", "hides", "reason"),
    [
        ("egl", (*EGL, *OSMESA), "its library is missing\nallowed:"),
        ("osmesa", (*EGL, *OSMESA), "its library is missing\nallowed:"),
        ("off", (), ""),
        ("nonsense", (), ""),
        ("glfw", (), ""),
    ],
)
def test_only_the_requested_backend_is_tried(
    named: str, hides: tuple[str, ...], reason: str, tmp_path: Path
) -> None:
    done = elsewhere(["-c", DRAW], LD_LIBRARY_PATH=hidden(tmp_path, *hides), MUJOCO_GL=named)
    assert f"Tried MUJOCO_GL={named}: {reason}" in done.stdout, done.stderr
    assert "apt-get install libegl1 libgl1-mesa-dri, or libosmesa6" in done.stdout


@pytest.mark.parametrize("broken", ["missing", "without a driver"])
def test_osmesa_draws_if_egl_does_not_work(broken: str, tmp_path: Path) -> None:
    how = (
        {"LD_LIBRARY_PATH": hidden(tmp_path, *EGL)}
        if broken == "missing"
        else {"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent", "__EGL_VENDOR_LIBRARY_FILENAMES": ""}
    )
    assert "Tried MUJOCO_GL=egl" in elsewhere(["-c", DRAW], MUJOCO_GL="egl", **how).stdout
    done = elsewhere(["-c", DRAW], **how)
    assert done.stdout == "drawn\n", f"needs libosmesa6: {done.stdout}{done.stderr}"


def test_the_command_reports_all_backends_and_writes_nothing(tmp_path: Path, short: Scenario) -> None:
    for folder in ("lib", "work"):
        (tmp_path / folder).mkdir()
    out, none = tmp_path / "work" / "run.png", {"LD_LIBRARY_PATH": hidden(tmp_path / "lib", *EGL, *OSMESA)}
    log = write_log(tmp_path / "run.mcap", [simulate_run(short, plant="analytic")])
    done = elsewhere(["-m", "cranectl", "render", str(log), str(out)], **none)
    assert done.returncode == 2
    assert "MUJOCO_GL=egl: its library is missing; MUJOCO_GL=osmesa: its library is missing" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(out.parent.iterdir()) == []


def test_a_module_of_the_working_directory_is_not_run_to_look_for_opengl(tmp_path: Path) -> None:
    """Only the child could run it: `-P` keeps it from this process."""
    imported = write_shadowing_modules(tmp_path)
    script = "from cranectl.tools.render import opengl; print(opengl._probe_backend('egl'))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout
    assert imported.read_text() == ""
