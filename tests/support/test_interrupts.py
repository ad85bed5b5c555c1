"""Signals that end a run, and those that come while a file is finished."""

import _thread
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.cli import output
from cranectl.cli.main import cli, main
from cranectl.support.interrupts import (
    SIGNALS,
    heed_interrupts,
    interrupt,
    interrupts_wait,
    reported_when_slow,
)
from tests.pace import HANG

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def usual_signals() -> Iterator[None]:
    """Commands that ran in this process before had them changed."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL if number != signal.SIGINT else signal.default_int_handler)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", SIGNALS)
def test_each_of_them_interrupts_once(number: signal.Signals) -> None:
    """A shell passes its hang-up on to those who were hung up on already."""
    assert signal.SIGHUP in SIGNALS
    heed_interrupts(interrupt)
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)
    os.kill(os.getpid(), signal.SIGHUP)


@pytest.mark.parametrize("number", SIGNALS)
def test_an_interrupt_in_a_callback_is_raised_again(number: signal.Signals) -> None:
    """A library that calls Python reports exceptions and goes on: LLVM does, while it compiles."""
    script = (
        "import ctypes, os, time; from cranectl.support.interrupts import *\n"
        f"heed_interrupts(interrupt); end = lambda: os.kill(os.getpid(), {number:d})\n"
        "callback = ctypes.CFUNCTYPE(None)(end)\n"
        f"try:\n    callback(); time.sleep({HANG})\nexcept KeyboardInterrupt: print('interrupted')"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "interrupted\n", "")


def test_only_after_an_interrupt_nothing_is_said_of_objects_that_it_cut_short() -> None:
    """A destructor of llvmlite fails where the making of its object was interrupted."""
    script = (
        "import os, sys; from cranectl.support.interrupts import *\n"
        "class Half:\n"
        "    def __init__(self, signal): os.kill(os.getpid(), signal); self.whole = True\n"
        "    def __del__(self): del self.whole\n"
        "heed_interrupts(interrupt)\n"
        "half = Half(0); del half.whole; del half; print('-', file=sys.stderr)\n"
        f"try:\n    Half({signal.SIGTERM:d})\nexcept KeyboardInterrupt: pass"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    before, _, after = done.stderr.partition("\n-\n")
    assert "AttributeError" in before
    assert (done.returncode, after) == (0, "")


def test_a_lack_of_memory_while_objects_are_discarded_is_one_line() -> None:
    """A generator of Numba that is closed while memory lacks cannot pass on the exception."""
    script = (
        "from cranectl.support.interrupts import *\n"
        "def lacking():\n"
        "    try:\n        yield\n    finally:\n        raise MemoryError\n"
        "heed_interrupts(interrupt); generator = lacking(); next(generator); del generator"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stderr == "cranectl: there was not enough memory to discard an object in order\n"


def test_the_handlers_before_can_be_put_back() -> None:
    assert heed_interrupts(interrupt) == {
        signal.SIGINT: signal.default_int_handler,
        signal.SIGTERM: signal.SIG_DFL,
        signal.SIGHUP: signal.SIG_DFL,
    }


@pytest.mark.parametrize("number", SIGNALS)
def test_what_was_ignored_at_the_start_stays_ignored(number: signal.Signals) -> None:
    """As by nohup, or in the background of a script."""
    script = (
        "import os, sys; from cranectl.support.interrupts import *\n"
        f"heed_interrupts(interrupt); os.kill(os.getpid(), {number:d}); print('goes on')"
    )
    command = ["sh", "-c", f'trap \'\' {number.name[3:]}; exec "$0" -c "$1"', sys.executable, script]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "goes on\n", "")


LOADING = "import time; print('loading', flush=True); time.sleep(60)"
COMPILED = f"try:\n    {LOADING}\nexcept BaseException as error: raise ImportError('failed') from error"


@pytest.mark.parametrize("library", [f"exec({LOADING!r})", COMPILED])
@pytest.mark.parametrize("number", SIGNALS)
def test_an_interrupt_counts_while_the_command_is_loaded(
    number: signal.Signals, library: str, tmp_path: Path
) -> None:
    """The first thing that takes its time there is click.

    Code in strings is what dataclasses make; compiled libraries turn interrupts into errors of their own.
    """
    (tmp_path / "click.py").write_text(library)
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    with subprocess.Popen(
        [sys.executable, "-m", "cranectl", "list"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "loading\n"
        process.send_signal(number)
        _, error = process.communicate(timeout=HANG)
    assert (process.returncode, error) == (130, "cranectl: interrupted\n")


@pytest.mark.parametrize(("cause", "code"), [(KeyboardInterrupt(), 130), (None, 70)])
def test_an_interrupt_counts_while_a_command_loads_what_it_needs(
    cause: BaseException | None, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failed(**_: object) -> None:
        raise ImportError("initialization failed") from cause

    monkeypatch.setattr(cli, "main", failed)
    assert main(["list"]) == code


def test_an_interrupt_waits_for_the_end_of_the_block() -> None:
    steps = []

    def interrupted() -> None:
        with interrupts_wait():
            os.kill(os.getpid(), signal.SIGINT)
            steps.append("after the signal")

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert steps == ["after the signal"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_after_an_error_signals_are_as_before() -> None:
    with pytest.raises(OSError, match="full"), interrupts_wait():
        raise OSError("full")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ignored_signals_stay_ignored() -> None:
    """Workers of a pool ignore them: their parent decides."""
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with interrupts_wait():
            os.kill(os.getpid(), signal.SIGINT)
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, previous)


def test_other_threads_pass() -> None:
    passed = []

    def work() -> None:
        with interrupts_wait():
            passed.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert passed == [signal.default_int_handler]


def test_nothing_waits_for_a_thread_that_cannot_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that lacks memory ends before it says that it has begun, and `Thread.start` waits for that."""
    monkeypatch.setattr(_thread, "start_new_thread", lambda *_: 0)
    monkeypatch.setattr(threading, "_start_new_thread", lambda *_: pytest.fail("would wait for ever"))
    monkeypatch.setattr(output, "LINE_EVERY", 0.01)
    with reported_when_slow("a file has been loading"), output.progress_bar(1.0, "run") as advance:
        advance(1.0)
