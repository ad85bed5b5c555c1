"""The cache of compiled code."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cranectl import jit


@pytest.fixture(autouse=True)
def fresh_cache_directory() -> object:
    jit.cache_directory.cache_clear()
    yield
    jit.cache_directory.cache_clear()


def test_cache_is_named_after_the_sources(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Numba would not notice a change in a callee of another file; the name of the folder does."""
    package = tmp_path / "package"
    package.mkdir()
    (package / "a.py").write_text("x = 1")
    monkeypatch.setattr(jit, "_PACKAGE", package)
    before = jit.source_fingerprint()
    (package / "a.py").write_text("x = 2")
    assert jit.source_fingerprint() != before


def test_chosen_directory_wins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert jit.cache_directory().parent == tmp_path


def test_unwritable_directories_are_passed_over(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A file where a directory should be cannot be written by anyone, root included."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    assert jit.cache_directory().is_dir()
    assert tmp_path not in jit.cache_directory().parents


def test_compiled_functions_leave_numbas_own_setting_alone() -> None:
    import numba

    before = numba.config.CACHE_DIR

    @jit.jit
    def double(x):
        return 2 * x

    assert double(2) == 4
    assert before == numba.config.CACHE_DIR


RUN = """
import sys
import numba.core.event as event
compiled = []
class Count(event.Listener):
    def on_start(self, event): compiled.append(event.data["dispatcher"])
    def on_end(self, event): pass
{limit}
with event.install_listener("numba:compile", Count()):
    from cranectl.flatness import states_and_inputs
    import numpy as np
    row = np.zeros((1, 15))
    row[0, 2] = -1.0
    states, _ = states_and_inputs(row, 9.81)
    assert states[0, 4] == 1.0
print(len(compiled))
"""
FULL = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
"""


def compiled_in_a_process(cache: Path, limit: str = "") -> int:
    environment = {"NUMBA_CACHE_DIR": str(cache), "PATH": os.defpath}
    command = [sys.executable, "-c", RUN.replace("{limit}", limit)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


def test_a_damaged_cache_is_compiled_anew_and_healed(tmp_path: Path) -> None:
    assert compiled_in_a_process(tmp_path) > 0
    assert compiled_in_a_process(tmp_path) == 0
    for suffix, damage in (("nbc", b""), ("nbi", b"garbage"), ("nbc", b"\x80\x05garbage"), ("nbi", b"")):
        files = list(tmp_path.rglob(f"*.{suffix}"))
        assert files
        for path in files:
            path.write_bytes(damage)
        assert compiled_in_a_process(tmp_path) > 0
        assert compiled_in_a_process(tmp_path) == 0


def test_a_disk_too_full_for_the_cache_is_no_error(tmp_path: Path) -> None:
    """A limit on file size stops writing in the middle, as a full disk does."""
    assert compiled_in_a_process(tmp_path, FULL) > 0
    assert compiled_in_a_process(tmp_path) > 0, "nothing broken was left to be taken for a cache"
    assert compiled_in_a_process(tmp_path) == 0
