"""Runs against each other: plants, golden logs, merged logs, and the limits of all that."""

from cranectl.compare.runs import (
    COMPARED_GROUPS,
    Agreement,
    Comparison,
    against_reference,
    compare_runs,
    compared_signals,
    differing_fields,
    ended_as_expected,
    judge,
    least_good,
    named_signals,
)

__all__ = [
    "COMPARED_GROUPS",
    "Agreement",
    "Comparison",
    "against_reference",
    "compare_runs",
    "compared_signals",
    "differing_fields",
    "ended_as_expected",
    "judge",
    "least_good",
    "named_signals",
]
