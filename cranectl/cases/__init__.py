"""One scenario, controller and drive on the plants, judged; many at once."""

from cranectl.cases.case import (
    LOG_DIRECTORY,
    Case,
    CaseResult,
    Failure,
    RunSummary,
    check_apart,
    default_log,
    make_case,
    run_case,
    try_case,
)

__all__ = [
    "LOG_DIRECTORY",
    "Case",
    "CaseResult",
    "Failure",
    "RunSummary",
    "check_apart",
    "default_log",
    "make_case",
    "run_case",
    "try_case",
]
