"""Child processes: they answer, and however they end, or do not, their parent says how and goes on."""

import math
import os
import re
import signal
import sys
import time
from collections.abc import Callable

import pytest

from cranectl.support import children
from cranectl.support.children import Child, Program, Timeout
from cranectl.support.errors import InputError
from cranectl.support.parent import Parent
from tests.conftest import ROOT
from tests.pace import HANG

START = {"spawned": Child.spawn, "forked": Child.fork}


@pytest.fixture(params=START)
def start(request: pytest.FixtureRequest) -> Callable[..., Child]:
    return START[request.param]


def die(parent: Parent) -> None:
    parent.send("first")
    os.kill(os.getpid(), signal.SIGSEGV)


def leave(parent: Parent) -> None:
    parent.send("first")
    os._exit(5)


def be_killed(parent: Parent) -> None:
    parent.send("first")
    os.kill(os.getpid(), signal.SIGKILL)


def hang(parent: Parent) -> None:
    parent.send("first")
    time.sleep(10.0 * HANG)


def close_and_hang(parent: Parent) -> None:
    parent.send("first")
    parent.connection.close()
    time.sleep(10.0 * HANG)


def start_a_program(parent: Parent) -> None:
    """Start what outlives its parent, and say so before and after."""
    parent.send(Parent.STARTING)
    program = os.posix_spawn("/bin/sleep", ["sleep", str(10.0 * HANG)], {})
    parent.send(Parent.STARTING)
    parent.send(program)
    time.sleep(10.0 * HANG)


def refuse(parent: Parent) -> None:
    parent.send(InputError("no", allowed="yes", remedy="do"))
    time.sleep(10.0 * HANG)


def double(parent: Parent) -> None:
    for number in parent.requests():
        parent.send(2 * number)


@pytest.mark.parametrize(
    ("work", "text", "is_killed", "is_silent"),
    [
        (die, "ended its process with SIGSEGV", False, False),
        (leave, "ended its process with exit code 5", False, False),
        (be_killed, "ended its process with SIGKILL", True, False),
        (hang, "took more than 0.5 s for a block", False, True),
        (close_and_hang, "took more than 0.5 s for a block", False, True),
    ],
)
def test_a_lost_child_is_noticed_after_its_last_message(
    work: Callable[..., None], text: str, is_killed: bool, is_silent: bool, start: Callable[..., Child]
) -> None:
    child = start(work)
    assert child.receive(HANG) == "first"
    for _ in range(1 if is_silent else 2):
        with pytest.raises(Child.Error) as caught:
            child.receive(0.5 if is_silent else HANG)
        lost = caught.value
        assert (str(lost), lost.is_killed, lost.is_silent) == (text, is_killed, is_silent)
    assert not is_running(child.pid)
    child.end()  # once more


def test_who_ends_with_a_signal_of_its_own_was_not_killed() -> None:
    killed = [
        code
        for code in (0, 1, 75, *(-number for number in signal.Signals))
        if Child.Error(code, 1.0).is_killed
    ]
    assert sorted(killed) == sorted((-signal.SIGKILL, -signal.SIGTERM))


def test_no_timeout_counts_while_a_program_starts_which_ends_with_the_child(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    allowed: list[float] = []

    class Noted(Timeout):
        def __init__(self, pid: int, seconds: float) -> None:
            allowed.append(seconds)
            super().__init__(pid, math.inf)

    monkeypatch.setattr(children, "Timeout", Noted)
    child = Child.fork(start_a_program)
    program = child.receive(7.0)
    assert allowed == [7.0, math.inf, 7.0]
    assert is_running(program)
    child.end()
    assert not is_running(child.pid)
    deadline = time.monotonic() + HANG
    while is_running(program):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_an_error_that_a_child_sends_is_raised(start: Callable[..., Child]) -> None:
    child = start(refuse)
    with pytest.raises(InputError, match="no"):
        child.receive(HANG)
    child.end()


def test_a_child_answers_until_its_parent_has_no_more_requests() -> None:
    child = Child.spawn(double)
    for number in (3, 4):
        child.send(number)
        assert child.receive(HANG) == 2 * number
    child.send(None)
    with pytest.raises(Child.Error, match="exit code 0"):
        child.receive(HANG)
    with pytest.raises(Child.Error, match="exit code 0"):
        child.send(5)


def test_a_look_is_taken_while_a_child_is_waited_for() -> None:
    looks = iter([None, None, InputError("enough")])

    def look() -> None:
        if error := next(looks):
            raise error

    child = Child.fork(hang)
    assert child.receive(HANG) == "first"
    with pytest.raises(InputError, match="enough"):
        child.receive(HANG, look)
    child.end()


def test_a_program_answers_or_is_ended() -> None:
    echo = "import sys; print(sys.stdin.read()[::-1], end=''); print('oh', file=sys.stderr); sys.exit(3)"
    command = [sys.executable, "-c", echo]
    assert Program.ask(command, HANG, question="abc") == (3, "cba", "oh\n")
    with pytest.raises(TimeoutError):
        Program.ask([sys.executable, "-c", "while True: pass"], 0.5)


def test_one_module_starts_processes() -> None:
    """What else does so talks in another way, or makes the server that workers are forked from."""
    starts = r"subprocess|os\.fork|os\.pipe|Popen|[pP]rocess\(|ProcessPool|killpg|waitpid|posix_spawn"
    found = {
        str(path.relative_to(ROOT / "cranectl"))
        for path in (ROOT / "cranectl").rglob("*.py")
        if re.search(rf"\b(?:{starts})", path.read_text())
    }
    talks, serves = "tools/export/loaders/process_controller.py", "cases/workers.py"
    assert found == {"support/children.py", talks, serves}


def test_time_without_a_processor_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    now, waited = [100.0], [7.0]
    monkeypatch.setattr(children, "processor_wait", lambda _pid: waited[0])
    timeout = Timeout(1, 10.0, lambda: now[0])
    assert timeout.left == 10.0
    now[0], waited[0] = 160.0, 62.0
    assert timeout.left == pytest.approx(5.0)
    now[0] = 166.0
    assert timeout.left == 0.0
    assert Timeout(1, float("inf"), lambda: now[0]).left == float("inf")
    monkeypatch.undo()
    assert 0.0 <= children.processor_wait(os.getpid()) < 1e6
    assert children.processor_wait(2**30) == 0.0


def is_running(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return True
