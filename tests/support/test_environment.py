"""Failures of the machine: how they are told from those of what is tested, and how time is counted."""

import errno
import os
import signal

import pytest

from cranectl.support.errors import InputError, MachineError, is_of_machine, was_killed, with_retries


def caused(error: Exception, cause: BaseException) -> Exception:
    error.__cause__ = cause
    return error


def test_a_lack_of_memory_disk_or_handles_is_of_the_machine() -> None:
    for number in (errno.ENOSPC, errno.ENOMEM, errno.EMFILE, errno.EIO):
        assert is_of_machine(OSError(number, os.strerror(number)))
    assert is_of_machine(MemoryError())
    unmapped = ImportError("libopenblas.so: failed to map segment from shared object")
    assert is_of_machine(caused(ImportError("Importing the numpy C-extensions failed."), unmapped))
    assert not is_of_machine(ImportError("No module named 'numpy'"))
    assert is_of_machine(caused(RuntimeError("LLVM cannot compile"), MemoryError()))
    for other in (OSError(errno.ENOENT, "no file"), ValueError("a"), ZeroDivisionError(), RuntimeError()):
        assert not is_of_machine(other)


def test_a_process_that_is_killed_did_not_end_itself() -> None:
    assert was_killed(-signal.SIGKILL)
    assert was_killed(-signal.SIGTERM)
    assert not any(map(was_killed, (0, 1, 75, -signal.SIGSEGV, -signal.SIGABRT)))


def test_only_what_the_machine_fails_at_is_tried_again() -> None:
    tries: list[int] = []

    def attempt(error: Exception, times: int) -> str:
        tries.append(1)
        if len(tries) <= times:
            raise error
        return "done"

    assert with_retries(lambda: attempt(MemoryError(), 2)) == "done"
    assert len(tries) == 3
    tries.clear()
    with pytest.raises(MachineError, match="MemoryError") as caught:
        with_retries(lambda: attempt(MemoryError(), 9))
    assert len(tries) == 3
    assert "free memory or disk space" in caught.value.remedy
    for error in (ValueError("own"), InputError("own")):
        tries.clear()
        with pytest.raises(type(error), match="own"):
            with_retries(lambda error=error: attempt(error, 9))  # type: ignore[misc]
        assert len(tries) == 1
