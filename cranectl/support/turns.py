"""Let the threads of a program take turns at an object whose memory compiled code uses, and at forks.

Compiled code works on addresses and lets other threads run meanwhile. If another thread began the same run
again, it would free this memory, and the process would end.
"""

import functools
import os
import threading
from collections.abc import Callable
from types import FunctionType
from typing import Any


class TakesTurns:
    """An object whose public methods and properties one thread calls at a time; the others wait.

    A class that derives from it need not do anything for that. Methods may call one another.
    """

    _turn: Any  # threading.RLock, which the type checker knows as a function

    def __new__(cls, *_arguments: Any, **_options: Any) -> Any:
        """Make the lock before the object itself can be used."""
        made = super().__new__(cls)
        made._turn = threading.RLock()
        return made

    def __init_subclass__(cls, **options: Any) -> None:
        """Wrap what is public in the new class."""
        super().__init_subclass__(**options)
        for name, member in list(vars(cls).items()):
            if name.startswith("_"):
                continue
            if isinstance(member, FunctionType):
                setattr(cls, name, _in_turn(member))
            elif isinstance(member, property):
                get, put, delete = (
                    part and _in_turn(part) for part in (member.fget, member.fset, member.fdel)
                )
                setattr(cls, name, property(get, put, delete, doc=member.__doc__))


def _in_turn(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return `method`, which waits until no other thread is in a method of the same object."""

    @functools.wraps(method)
    def waiting(self: TakesTurns, *arguments: Any, **options: Any) -> Any:
        with self._turn:
            return method(self, *arguments, **options)

    return waiting


def held_in_forks(acquire: Callable[[], object], release: Callable[[], object]) -> None:
    """Let each fork of this process acquire a lock before and release it after, in parent and child.

    Only the thread that forks lives on in the child. If another thread held the lock, the child would wait
    for it for ever. Locks are acquired in the reverse order of these calls.
    """
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(before=acquire, after_in_parent=release, after_in_child=release)
