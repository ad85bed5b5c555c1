"""Exit codes of every command."""

from enum import IntEnum


class ExitCode(IntEnum):
    """How a command ended, as its exit code tells the shell; `meaning` says it in words."""

    GOOD = 0, "good: runs ended as expected, limits were kept"
    LIMIT_EXCEEDED = 1, "a limit was exceeded: agreement, a comparison, a bound, a certificate"
    BAD_INPUT = 2, "bad input; the message says what was found, what is allowed, what to do"
    RUN_STOPPED = 3, "a run stopped early, with a slack rope for example; its log is readable"
    UNFORESEEN = 70, "an error that nobody foresaw; --traceback tells where"  # EX_SOFTWARE of sysexits
    INTERRUPTED = 130, "interrupted: Ctrl-C, a request to terminate, a terminal that is gone"  # 128 + SIGINT

    meaning: str

    def __new__(cls, code: int, meaning: str) -> "ExitCode":
        """Return the member for `code`, with its meaning."""
        member = int.__new__(cls, code)
        member._value_, member.meaning = code, meaning
        return member
