"""The cache of compiled code."""

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
