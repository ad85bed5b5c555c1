"""Exit codes of every command."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cranectl.cases.case import CaseResult
    from cranectl.cases.workers import Result

GOOD = 0
LIMIT_EXCEEDED = 1
BAD_INPUT = 2
RUN_STOPPED = 3
UNFORESEEN = 70  # EX_SOFTWARE of sysexits
INTERRUPTED = 130  # 128 + SIGINT, as shells have it

MEANINGS = {
    GOOD: "good: runs ended as expected, limits were kept",
    LIMIT_EXCEEDED: "a limit was exceeded: agreement, a comparison, a bound, a certificate",
    BAD_INPUT: "bad input; the message says what was found, what is allowed, what to do",
    RUN_STOPPED: "a run stopped early, with a slack rope for example; its log is readable",
    UNFORESEEN: "an error that nobody foresaw; --traceback tells where",
    INTERRUPTED: "interrupted: Ctrl-C, a request to terminate, a terminal that is gone",
}


def of_run(result: "CaseResult") -> int:
    """The code that says most of what happened: interrupted, stopped, disagreed, good."""
    if result.interrupted:
        return INTERRUPTED
    if result.stopped:
        return RUN_STOPPED
    return GOOD if result.passed else LIMIT_EXCEEDED


def of_validation(results: Sequence["Result"], *, interrupted: bool) -> int:
    """The code that says most: interrupted, unforeseen or a worker died, bad input, stopped, disagreed, good.

    A run that stops as its scenario expects is good.
    """
    from cranectl.cases.case import CaseResult, Failure

    if interrupted:
        return INTERRUPTED
    failures = [result for result in results if isinstance(result, Failure)]
    if any(result is None for result in results) or not all(failure.bad_input for failure in failures):
        return UNFORESEEN
    if failures:
        return BAD_INPUT
    finished = [result for result in results if isinstance(result, CaseResult)]
    if any(result.stopped and not result.as_expected for result in finished):
        return RUN_STOPPED
    return GOOD if all(result.passed for result in finished) else LIMIT_EXCEEDED
