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


def of_results(results: Sequence["CaseResult"]) -> int:
    """The code that says most of what happened: interrupted, stopped, disagreed, good."""
    if any(result.interrupted for result in results):
        return INTERRUPTED
    if any(result.stopped for result in results):
        return RUN_STOPPED
    agreements = (result.agreement for result in results)
    passed = all(agreement.passed for agreement in agreements if agreement is not None)
    return GOOD if passed else LIMIT_EXCEEDED
