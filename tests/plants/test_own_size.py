"""A model file that asks for too much, or reads what it must not, is refused before the engine reads it."""

import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from cranectl.plants.mujoco.own_file import OwnFile
from cranectl.scenario.rig import ModelNames
from cranectl.support.errors import InputError
from cranectl.support.search_path import SafePath
from tests.plants.own_models import MODELS, changed
from tests.shadowing_modules import write_shadowing_modules

TENDON = MODELS / "tendon.xml"
ALLOWED_GROWTH = 100_000  # [KiB] of memory by a refusal; the models ask for a gigabyte or more


def asset(text: str) -> tuple[str, str]:
    """Return the change of the model that gives it an asset."""
    return "<worldbody>", f"<asset>{text}</asset><worldbody>"


# By what is asked for: the text of the model that is replaced, and the new one.
TOO_LARGE = {
    "900000000 pixels or points in <texture>": asset(
        '<texture name="t" type="2d" builtin="flat" width="30000" height="30000"/>'),
    "600000000 pixels or points in <texture>": asset(  # of six faces
        '<texture name="t" builtin="flat" width="10000"/>'),
    "32000000 pixels or points in <texture>": asset("".join(
        f'<texture name="t{k}" type="2d" builtin="flat" width="4000" height="4000"/>' for k in range(2))),
    "400000000 pixels or points in <hfield>": asset(
        '<hfield name="h" nrow="20000" ncol="20000" size="1 1 1 1"/>'),
    "500000000 nuserdata in <size>": ("<worldbody>", '<size nuserdata="5e8"/><worldbody>'),
    "1000000000 nuser_geom in <size>": ("<worldbody>", '<size nuser_geom="1000000000"/><worldbody>'),
    "5.36870912e+11 memory in <size>": ("<worldbody>", '<size memory="500G"/><worldbody>'),
    "1000000000 size in <numeric>": (
        "<worldbody>", '<custom><numeric name="n" size="1000000000"/></custom><worldbody>'
    ),
    "1000000 copies of a body": (
        "</worldbody>",
        2 * '<replicate count="1000">' + '<geom size="1"/>' + 2 * "</replicate>" + "</worldbody>",
    ),
    "12 params in <mesh>": asset('<mesh name="m" builtin="sphere" params="12"/>'),
    "infinitely many": ("<worldbody>", '<size nuserdata="nan"/><worldbody>'),
}  # fmt: skip


@pytest.mark.parametrize("asked", TOO_LARGE)
def test_a_model_that_asks_for_too_much_is_refused(asked: str, tmp_path: Path) -> None:
    file = changed(TENDON, tmp_path, TOO_LARGE[asked])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError) as error:
        OwnFile(file, ModelNames())
    found = f"{file} asks for {asked}".replace("infinitely many", "nan nuserdata in <size>")
    assert (error.value.found, error.value.allowed[:8]) == (found, "at most ")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < ALLOWED_GROWTH


def test_as_much_as_is_allowed_is_taken(tmp_path: Path) -> None:
    text = '<texture name="t" type="2d" builtin="flat" width="512" height="512"/><mesh name="m" '
    text += 'builtin="sphere" params="3"/>'
    size = '<size memory="10M" nuserdata="1000"/><worldbody>'
    file = changed(TENDON, tmp_path, asset(text), ("<worldbody>", size))
    assert OwnFile(file, ModelNames()).model.nuserdata == 1000


def mesh(name: str) -> tuple[str, str]:
    return asset(f'<mesh name="m" file="{name}"/>')


def test_only_regular_files_in_the_folder_of_the_model_are_read(tmp_path: Path) -> None:
    """Else a pipe would be waited for, and a file elsewhere would be read before it is refused."""
    folder = tmp_path / "model"
    (folder / "sub.obj").mkdir(parents=True)
    os.mkfifo(folder / "pipe.obj")
    os.mkfifo(tmp_path / "pipe.xml")
    (tmp_path / "outside.xml").write_text("<no XML")
    (folder / "link.obj").symlink_to("/dev/zero")
    (folder / "link.xml").symlink_to(tmp_path / "outside.xml")
    (folder / "sub.xml").write_text('<mujoco><asset><mesh name="m" file="../m.obj"/></asset></mujoco>')
    (folder / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(8) + 2 * (30000).to_bytes(4, "big"))
    picture = asset('<texture name="t" type="2d" file="picture.png"/>')
    for change, said in (
        (mesh("pipe.obj"), "reads pipe.obj, which is a directory, a pipe or a device"),
        (mesh("sub.obj"), "reads sub.obj, which is a directory, a pipe or a device"),
        (mesh("link.obj"), "reads link.obj"),
        (mesh("/dev/zero"), "reads /dev/zero"),
        (mesh("/etc/m.obj"), "reads /etc/m.obj"),
        *(
            (("<worldbody>", f'<include file="{name}"/><worldbody>'), f"reads {name}")
            for name in ("../pipe.xml", "../outside.xml", "link.xml")
        ),
        (asset('<model name="sub" file="sub.xml"/>'), "reads ../m.obj"),
        (asset('<texture name="t" type="cube" fileup="../a.png"/>'), "reads ../a.png"),
        (picture, "asks for 900000000 pixels in picture.png"),
    ):
        with pytest.raises(InputError, match=re.escape(said)) as error:
            OwnFile(changed(TENDON, folder, change), ModelNames())
        assert error.value.allowed
        assert error.value.remedy


@pytest.mark.parametrize("number", ["nan", "inf"])
def test_numbers_that_are_not_finite_are_refused(number: str, tmp_path: Path) -> None:
    file = changed(TENDON, tmp_path, ('name="x"', f'name="x" damping="{number}"'))
    with pytest.raises(InputError, match="dof_damping of its model has numbers that are infinite or NaN"):
        OwnFile(file, ModelNames())


def test_an_unstable_model_ends_its_run_and_writes_nothing_beside_it(tmp_path: Path) -> None:
    """The engine's own handlers would write to the screen and to MUJOCO_LOG.TXT."""
    changed(TENDON, tmp_path, ('name="x"', 'name="x" damping="1e7"'))
    command = [sys.executable, "-m", "cranectl", "run", "fast-diagonal", "--plants", "mine.xml"]
    settings = ["--drive", "velocity", "--set", "rig.winch_mass=1e-5", "--set", "disturbances=[]"]
    done = subprocess.run(
        [*command, *settings, "--out", "run.mcap"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 3, done.stderr
    assert "completed" not in done.stdout
    assert "WARNING" not in done.stdout + done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"mine.xml", "run.mcap"}


def test_a_module_of_the_working_directory_is_not_run_with_the_engine(tmp_path: Path) -> None:
    """One of the engine's libraries starts `python -c` when it is loaded."""
    imported = write_shadowing_modules(tmp_path)
    environment = {
        key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", SafePath.VARIABLE)
    }
    script = "import os; import cranectl.plants.mujoco.plant; print(os.environ.get('PYTHONSAFEPATH'))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", script],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert imported.read_text() == ""
    assert (done.stdout, done.stderr) == ("None\n", "")
