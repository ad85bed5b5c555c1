"""The cache of compiled code."""

import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cranectl.support import directories, kernel_cache, sources
from cranectl.support.jit import jit

SOURCES = [Path(__file__)]


@pytest.fixture(autouse=True)
def fresh_cache_directory() -> object:
    directories.cache_directory.cache_clear()
    yield
    directories.cache_directory.cache_clear()


@pytest.mark.parametrize(
    "through", ["from cranectl.b import y", "from cranectl import b", "import cranectl.b"]
)
def test_a_change_in_an_imported_module_counts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, through: str
) -> None:
    """Numba would not notice a change in a callee of another file; the digest of the sources does."""
    monkeypatch.setattr(sources, "PACKAGE", tmp_path)
    b = "    from cranectl.sub import (\n    z,\n)"
    contents = {"a": through, "b": b, "sub/__init__": "z = 1", "d": ""}
    (tmp_path / "sub").mkdir()
    for name, text in contents.items():
        (tmp_path / f"{name}.py").write_text(text)

    def digest() -> str:
        sources.source_of.cache_clear()
        sources._imported.cache_clear()
        return sources.sources_digest(tmp_path / "a.py")

    before = digest()
    (tmp_path / "d.py").write_text("not imported")
    assert digest() == before
    (tmp_path / "sub/__init__.py").write_text("z = 2")
    assert digest() != before


def test_kernels_depend_on_every_module_that_they_call() -> None:
    """What the loop over the analytic plant is compiled from, but not the command line."""
    package = Path(kernel_cache.__file__).parents[1]
    seen = sources.imported_files(package / "simulate/loops.py", package / "plants/analytic.py")
    names = {str(path.relative_to(package)) for path in seen}
    kernels = {"model/dynamics.py", "controllers/flat.py", "plants/surroundings.py", "plants/dop853.py"}
    assert {*kernels, "signals.py"} <= names
    assert not any(name.startswith(("cli/", "report/", "log/")) for name in names)


def test_the_chosen_directory_is_closed_to_others(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    directory = directories.cache_directory()
    assert directory.parent == tmp_path
    assert stat.S_IMODE(directory.stat().st_mode) == stat.S_IRWXU, "nobody else may put code there"
    directory.chmod(0o777)
    directories.cache_directory.cache_clear()
    assert directories.cache_directory() == directory
    assert stat.S_IMODE(directory.stat().st_mode) == stat.S_IRWXU


def test_code_of_another_user_is_never_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is seen is what another user would have made: this process passes for somebody else."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    here = os.geteuid()
    (tmp_path / f"cranectl-{here + 1}").mkdir()
    file = kernel_cache._CheckedFile(str(tmp_path), "kernel", SOURCES)
    file.save("signature", "code")
    assert file.load("signature") == "code"
    monkeypatch.setattr(os, "geteuid", lambda: here + 1)
    assert file.load("signature") is None
    assert tmp_path not in directories.cache_directory().parents
    assert f"cranectl-{here + 1} (it belongs to another user)" in capsys.readouterr().err


@pytest.mark.parametrize("named", ["NUMBA_CACHE_DIR", "XDG_CACHE_HOME"])
def test_compiled_code_does_not_follow_the_working_directory(
    named: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(named, "here")
    monkeypatch.chdir(tmp_path)
    assert all(place.is_absolute() for place in directories._candidates())


NOWHERE = """
import subprocess, sys, tempfile
import cranectl.support.directories as directories
directories.cache_directory()
directories.cache_directory()
script = "import cranectl.support.directories as directories; print(directories.cache_directory())"
print(subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True))
"""


def test_no_place_for_the_cache_is_said_once_and_leaves_nothing(tmp_path: Path) -> None:
    """A file where a directory should be cannot be written by anyone, root included."""
    (tmp_path / "file").write_text("")
    (tmp_path / "temporary").mkdir()
    places = {"NUMBA_CACHE_DIR": str(tmp_path / "file"), "TMPDIR": str(tmp_path / "temporary")}
    command = [sys.executable, "-c", NOWHERE]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | places, check=True)
    (line,) = done.stderr.splitlines()
    assert str(tmp_path / "file") in line
    assert "NUMBA_CACHE_DIR names" in line
    (above,) = (tmp_path / "temporary").iterdir()
    assert str(above / "kernels-") in done.stdout, "a child shares the place"
    assert "cannot be kept" not in done.stdout, "and says nothing of it"
    assert not list(above.iterdir())


def test_compiled_functions_leave_numbas_own_setting_alone() -> None:
    import numba

    before = numba.config.CACHE_DIR

    @jit
    def double(x):
        return 2 * x

    assert double(2) == 4
    assert before == numba.config.CACHE_DIR


@pytest.mark.parametrize("terminal", [True, False])
def test_who_waits_at_a_terminal_is_told_once_that_it_compiles(
    terminal: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    kernel_cache._announce_compilation.cache_clear()

    def half(x):
        return x / 2

    assert (jit(half)(3.0), jit(half)(3)) == (1.5, 1.5)
    told = capsys.readouterr().err
    assert told.count(str(tmp_path)) == told.count("\n") == terminal
    kernel_cache._announce_compilation.cache_clear()
    assert jit(half)(3.0) == 1.5
    assert capsys.readouterr().err == "", "it was found compiled"


RUN = """
import sys
import numba.core.event as event
compiled = []
class Count(event.Listener):
    def on_start(self, event): compiled.append(event.data["dispatcher"])
    def on_end(self, event): pass
{limit}
with event.install_listener("numba:compile", Count()):
    from cranectl.model.flatness import angles_from_slopes
    assert angles_from_slopes(0.0, 0.0, 0.5, 0.25) == (0.0, 0.25, 0.0, 0.5)
print(len(compiled))
"""
FULL = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
"""


def compiled_in_a_process(cache: Path, limit: str = "") -> int:
    # Python itself would leave half a file of bytecode where files are limited.
    environment = {"NUMBA_CACHE_DIR": str(cache), "PATH": os.defpath, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", RUN.replace("{limit}", limit)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


def restore_as_a_job_does(cache: Path) -> None:
    """Pack a folder, and unpack it with new times of change, as the next job in CI does."""
    archive = shutil.make_archive(str(cache.with_name("packed")), "gztar", cache)
    shutil.rmtree(cache)
    shutil.unpack_archive(archive, cache, filter="data")
    for path in cache.rglob("*"):
        os.utime(path)


def flipped(at: float) -> Callable[[bytes], bytes]:
    """A bit flipped at a part of the length: in machine code it would end the process, or change a number."""

    def flip(content: bytes) -> bytes:
        byte = int(at * len(content))
        return content[:byte] + bytes([content[byte] ^ 1]) + content[byte + 1 :]

    return flip


@pytest.mark.slow
def test_a_damaged_cache_is_never_run_but_compiled_anew(tmp_path: Path) -> None:
    assert compiled_in_a_process(tmp_path) > 0
    for suffix in ("nbc", "nbi"):
        files = list(tmp_path.rglob(f"*.{suffix}"))
        assert files
        for path in files:
            path.write_bytes(flipped(0.5)(path.read_bytes()))
        assert compiled_in_a_process(tmp_path) > 0
    restore_as_a_job_does(tmp_path)
    assert compiled_in_a_process(tmp_path) == 0


@pytest.mark.parametrize("damage", [lambda _: b"", lambda _: b"garbage", flipped(0.1), flipped(0.98)])
@pytest.mark.parametrize("suffix", ["nbc", "nbi"])
def test_any_damage_is_found(tmp_path: Path, suffix: str, damage: Callable[[bytes], bytes]) -> None:
    file = kernel_cache._CheckedFile(str(tmp_path), "kernel", SOURCES)
    file.save("signature", "code")
    (path,) = tmp_path.glob(f"*.{suffix}")
    path.write_bytes(damage(path.read_bytes()))
    try:
        assert file.load("signature") is None
    except kernel_cache._DamageError:
        assert suffix == "nbc"


def test_code_of_other_sources_is_never_run(tmp_path: Path) -> None:
    """Two versions share a place: one renews a file between the other's reading of index and of data."""
    changed = tmp_path / "changed.py"
    changed.write_text("LENGTH = 1.0\n")
    file, other = (kernel_cache._CheckedFile(str(tmp_path), "kernel", of) for of in (SOURCES, [changed]))
    file.save("signature", "code")
    assert file.load("signature") == "code"
    assert other.load("signature") is None
    other.save("signature", "other code")
    with pytest.raises(kernel_cache._DamageError):
        file._load_data(file._data_name(1))


@pytest.mark.slow
def test_a_disk_too_full_for_the_cache_is_no_error(tmp_path: Path) -> None:
    """A limit on file size stops writing in the middle, as a full disk does."""
    assert compiled_in_a_process(tmp_path, FULL) > 0
    assert compiled_in_a_process(tmp_path) > 0, "nothing broken was left to be taken for a cache"
    assert compiled_in_a_process(tmp_path) == 0
