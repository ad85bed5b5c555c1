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
from cranectl.support import reported_when_slow
from cranectl.support.interrupts import Interruption
from tests.conftest import ROOT
from tests.pace import HANG


@pytest.fixture(autouse=True)
def usual_signals() -> Iterator[None]:
    """Commands that ran in this process before had them changed."""
    before = {number: signal.getsignal(number) for number in Interruption.SIGNALS}
    for number in Interruption.SIGNALS:
        signal.signal(number, signal.SIG_DFL if number != signal.SIGINT else signal.default_int_handler)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", Interruption.SIGNALS)
def test_each_of_them_interrupts_once(number: signal.Signals) -> None:
    """A shell passes its hang-up on to those who were hung up on already."""
    before = Interruption.heed()
    assert before == {
        signal.SIGINT: signal.default_int_handler,
        signal.SIGTERM: signal.SIG_DFL,
        signal.SIGHUP: signal.SIG_DFL,
    }
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)
    os.kill(os.getpid(), signal.SIGHUP)


CALLBACK = f"""
import ctypes, os, time
from cranectl.support.interrupts import *
Interruption.heed()
callback = ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), NUMBER))
try:
    callback(); time.sleep({HANG})
except KeyboardInterrupt:
    print('interrupted')
"""
IGNORED = """
import os
from cranectl.support.interrupts import *
Interruption.heed()
os.kill(os.getpid(), NUMBER)
print('goes on')
"""


@pytest.mark.parametrize("number", Interruption.SIGNALS)
@pytest.mark.parametrize(
    ("script", "before", "printed"),
    [(CALLBACK, "", "interrupted\n"), (IGNORED, "trap '' NAME; ", "goes on\n")],
    ids=["raised again after a callback of a library", "ignored since the start, as by nohup"],
)
def test_what_a_signal_does_to_a_process(
    number: signal.Signals, script: str, before: str, printed: str
) -> None:
    command = ["sh", "-c", f'{before.replace("NAME", number.name[3:])}exec "$0" -c "$1"', sys.executable]
    done = subprocess.run(
        [*command, script.replace("NUMBER", str(int(number)))], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, printed, "")


DISCARDED = f"""
import os, sys
from cranectl.support.interrupts import *
class Half:
    def __init__(self, signal): os.kill(os.getpid(), signal); self.whole = True
    def __del__(self): del self.whole
def lacking():
    try:
        yield
    finally:
        raise MemoryError
Interruption.heed()
half = Half(0); del half.whole; del half; print('-', file=sys.stderr)
generator = lacking(); next(generator); del generator
try:
    Half({signal.SIGTERM:d})
except KeyboardInterrupt:
    pass
"""


def test_objects_that_cannot_be_discarded_are_reported_until_an_interrupt() -> None:
    """Destructors fail where the making of an object was interrupted; a lack of memory is one line."""
    done = subprocess.run([sys.executable, "-c", DISCARDED], capture_output=True, text=True, check=False)
    before, _, after = done.stderr.partition("\n-\n")
    assert "AttributeError" in before
    assert after == "cranectl: there was not enough memory to discard an object in order\n"
    assert done.returncode == 0


LOADING = "import time; print('loading', flush=True); time.sleep(60)"
COMPILED = f"try:\n    {LOADING}\nexcept BaseException as error: raise ImportError('failed') from error"


@pytest.mark.parametrize("library", [f"exec({LOADING!r})", COMPILED])
@pytest.mark.parametrize("number", Interruption.SIGNALS)
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
        with Interruption.delayed():
            os.kill(os.getpid(), signal.SIGINT)
            steps.append("after the signal")

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert steps == ["after the signal"]
    with pytest.raises(OSError, match="full"), Interruption.delayed():
        raise OSError("full")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in workers of a pool, whose parent decides
    interrupted()
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_no_interrupt_waits_in_other_threads() -> None:
    passed = []

    def work() -> None:
        with Interruption.delayed():
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
    with reported_when_slow("a file has been loading"), output.Screen.progress_bar(1.0, "run") as advance:
        advance(1.0)
