"""Public methods and properties of an object are called by one thread at a time."""

import threading

from cranectl.simulate.open_run import OpenRun
from cranectl.simulate.open_runs import OpenRuns
from cranectl.support.turns import TakesTurns
from tests.pace import HANG


class Meeting(TakesTurns):
    def __init__(self) -> None:
        self.entered, self.may_leave = threading.Event(), threading.Event()

    def stay(self) -> None:
        self.entered.set()
        assert self.may_leave.wait(HANG)
        self._note()
        assert self.here == "here"  # a method may use another

    def visit(self) -> str:
        return "visited"

    @property
    def here(self) -> str:
        """Where it is."""
        return "here"

    def _note(self) -> None:
        """Do nothing."""


def test_a_thread_waits_until_another_has_left() -> None:
    meeting = Meeting()
    seen: list[str] = []
    staying = threading.Thread(target=meeting.stay)
    staying.start()
    assert meeting.entered.wait(HANG)
    others = [
        threading.Thread(target=lambda: seen.append(meeting.visit())),
        threading.Thread(target=lambda: seen.append(meeting.here)),
    ]
    for other in others:
        other.start()
        other.join(0.05)
        assert other.is_alive()
    meeting._note()  # what is private takes no turn
    assert not seen
    meeting.may_leave.set()
    for thread in (staying, *others):
        thread.join(HANG)
    assert sorted(seen) == ["here", "visited"]
    assert (Meeting.visit.__name__, Meeting.here.__doc__) == ("visit", "Where it is.")


def test_all_that_is_public_of_stepped_runs_takes_turns() -> None:
    for kind in (OpenRun, OpenRuns):
        for name, member in vars(kind).items():
            if not name.startswith("_"):
                assert hasattr(member.fget if isinstance(member, property) else member, "__wrapped__"), name
