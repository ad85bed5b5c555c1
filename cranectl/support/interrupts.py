"""Handle the signals that end a run in order: Ctrl-C, SIGTERM and the hang-up of a terminal.

A signal that is ignored when a process starts stays ignored. `nohup` does so with hang-ups, and a shell
script with Ctrl-C for programs that it starts in the background.
"""

import _thread
import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from types import FrameType
from typing import Any

from cranectl.support.errors import printable

SLOW = 10.0  # [s] after which unfinished work is reported
RETRY = 0.01  # [s] until an interrupt that was swallowed is raised again


def in_background(act: Callable[[], None]) -> None:
    """Run `act` in a thread that ends with the process at the latest; do not wait until it begins.

    `threading.Thread.start` waits for the new thread, for ever if there is too little memory to begin.
    """
    _thread.start_new_thread(act, ())


@contextlib.contextmanager
def reported_when_slow(what: str) -> Iterator[None]:
    """Report on standard error if `what`, such as "law.py has been loading", takes long; end nothing."""
    warning = f"cranectl: {printable(what)} for {SLOW:g} s now; Ctrl-C ends the command\n"
    ended = _thread.allocate_lock()

    def report() -> None:
        if not ended.acquire(timeout=SLOW):
            os.write(2, warning.encode())

    with ended:  # held until the block ends, for which `report` waits
        in_background(report)
        yield


def _raise_in_main_thread(number: signal.Signals) -> None:
    main = threading.main_thread().ident
    if main is not None and hasattr(
        signal, "pthread_kill"
    ):  # this also interrupts a system call in that thread
        signal.pthread_kill(main, number)
    else:
        _thread.interrupt_main(number)


class _RaiseAgain:
    """A `sys.unraisablehook` that raises an interrupt again where the interpreter could only report it.

    A callback of a library and a destructor cannot pass on an exception, so the run would continue. After an
    interrupt no other exception is reported, because destructors fail on incomplete objects. A lack of memory
    is reported in one line without a traceback, because the command says what to do about it.
    """

    def __init__(self) -> None:
        self.report = sys.unraisablehook
        self.handler: Any = None
        self.number = signal.SIGINT

    def __call__(self, unraisable: Any) -> None:
        if issubclass(unraisable.exc_type, MemoryError):
            os.write(2, b"cranectl: there was not enough memory to discard an object in order\n")
        elif self.handler is None:
            self.report(unraisable)
        elif isinstance(unraisable.exc_value, Interruption):
            signal.signal(self.number, self.handler)
            in_background(self._retry)

    def _retry(self) -> None:
        time.sleep(RETRY)
        _raise_in_main_thread(self.number)


class Interruption(KeyboardInterrupt):
    """A KeyboardInterrupt that lets this program choose the exit code.

    If Python's own KeyboardInterrupt passes through `exec` of a string, as when a dataclass is made, the
    interpreter ends by SIGINT even if the exception was caught.
    """

    SIGNALS = tuple(signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

    @staticmethod
    def is_cause_of(error: BaseException) -> bool:
        """Return True if an interrupt caused `error`, even if a library has wrapped it."""
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, KeyboardInterrupt):
            cause = cause.__cause__
        return cause is not None

    @classmethod
    def heed(cls, act: Callable[[], None] | None = None) -> Mapping[signal.Signals, Any]:
        """Call `act`, or raise this exception, at each signal that is not ignored; return former handlers.

        After the first signal further hang-ups are ignored, because a closed terminal sends more than one.
        """
        if not isinstance(sys.unraisablehook, _RaiseAgain):
            sys.unraisablehook = _RaiseAgain()
        hook = sys.unraisablehook
        hook.handler = None

        def interrupted(number: int, _frame: FrameType | None) -> None:
            hook.handler, hook.number = interrupted, signal.Signals(number)
            if hasattr(signal, "SIGHUP"):
                signal.signal(signal.SIGHUP, signal.SIG_IGN)
            if act is None:
                raise cls
            act()

        before = {number: signal.getsignal(number) for number in cls.SIGNALS}
        heeded = {number: handler for number, handler in before.items() if handler is not signal.SIG_IGN}
        for number in heeded:
            signal.signal(number, interrupted)
        return heeded

    @staticmethod
    @contextlib.contextmanager
    def delayed() -> Iterator[None]:
        """Delay signals until the end of the block, which should take less than a second.

        Python handles signals in the main thread only, so in other threads this has no effect.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        came: list[tuple[int, FrameType | None]] = []
        handlers = {number: signal.getsignal(number) for number in Interruption.SIGNALS}
        replaced = {number: handler for number, handler in handlers.items() if callable(handler)}
        for number in replaced:
            signal.signal(number, lambda *which: came.append(which))
        try:
            yield
        finally:
            for number, handler in replaced.items():
                signal.signal(number, handler)
            if came:
                replaced[signal.Signals(came[0][0])](*came[0])

    @staticmethod
    @contextlib.contextmanager
    def blocked() -> Iterator[None]:
        """Block signals for the processes started in the block; this process receives them at its end."""
        if not hasattr(signal, "pthread_sigmask"):
            yield
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, Interruption.SIGNALS)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
