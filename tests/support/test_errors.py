"""Errors say what was found, what is allowed and what to do; failures of the machine are told apart."""

import errno
import os

import pytest

from cranectl.support.errors import InputError, MachineError


def test_message_has_found_allowed_remedy() -> None:
    assert str(InputError("a", allowed="b", remedy="c")) == "found:   a\nallowed: b\nremedy:  c"
    assert str(InputError("a")) == "found:   a"


def test_the_nearest_name_comes_first_and_is_suggested_only_if_near() -> None:
    assert InputError.nearest("lqr", ["zzz", "pole-placement", "lqr", "aaa"])[0] == "lqr"
    assert InputError.nearest("q", ["bb", "aa"]) == ["aa", "bb"]
    assert "did you mean 'lqr'" in InputError.unknown("controller", "lq", ["lqr", "pole-placement"]).remedy
    assert "did you mean" not in InputError.unknown("controller", "xyz", ["lqr", "pole-placement"]).remedy


def caused(error: Exception, cause: BaseException) -> Exception:
    error.__cause__ = cause
    return error


def test_a_lack_of_memory_disk_or_handles_is_of_the_machine() -> None:
    unmapped = ImportError("libopenblas.so: failed to map segment from shared object")
    for error in (
        *(OSError(number, "") for number in (errno.ENOSPC, errno.ENOMEM, errno.EMFILE, errno.EIO)),
        MemoryError(),
        caused(ImportError("Importing the numpy C-extensions failed."), unmapped),
        caused(RuntimeError("LLVM cannot compile"), MemoryError()),
    ):
        assert MachineError.is_cause_of(error)
    others = (OSError(errno.ENOENT, os.strerror(errno.ENOENT)), ImportError("No module named 'numpy'"))
    assert not any(
        map(MachineError.is_cause_of, (*others, ValueError("a"), ZeroDivisionError(), RuntimeError()))
    )


@pytest.mark.parametrize(
    ("error", "failures", "raised", "tries"),
    [
        (MemoryError(), 2, None, 3),
        (MemoryError(), 9, MachineError, 3),
        (ValueError("own"), 9, ValueError, 1),
        (InputError("own"), 9, InputError, 1),
    ],
)
def test_only_what_the_machine_fails_at_is_tried_again(
    error: Exception, failures: int, raised: type[Exception] | None, tries: int
) -> None:
    tried: list[int] = []

    def attempt() -> str:
        tried.append(1)
        if len(tried) <= failures:
            raise error
        return "done"

    if raised is None:
        assert MachineError.retry(attempt) == "done"
    else:
        with pytest.raises(raised, match=r"MemoryError|own") as caught:
            MachineError.retry(attempt)
        assert type(caught.value) is raised
        assert getattr(caught.value, "remedy", "").startswith("free memory") == (raised is MachineError)
    assert len(tried) == tries
