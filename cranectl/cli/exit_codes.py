"""Exit codes of every command."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cranectl.cases import CaseResult

GOOD = 0
LIMIT_EXCEEDED = 1
BAD_INPUT = 2
RUN_STOPPED = 3
INTERRUPTED = 130  # 128 + SIGINT, as shells have it


def of_run(result: "CaseResult") -> int:
    """The code that says most of what happened: interrupted, stopped, disagreed, good."""
    if result.interrupted:
        return INTERRUPTED
    if result.stopped:
        return RUN_STOPPED
    return GOOD if result.passed else LIMIT_EXCEEDED


def of_validation(results: Sequence["CaseResult | None"], *, interrupted: bool) -> int:
    """As `of_run`, but a run that stops as its scenario expects is good; None is a case that was lost."""
    if interrupted:
        return INTERRUPTED
    finished = [result for result in results if result is not None]
    if any(result.stopped and not result.as_expected for result in finished):
        return RUN_STOPPED
    return GOOD if all(result is not None and result.passed for result in results) else LIMIT_EXCEEDED
