"""Judge a campaign by the number or the share of its runs that may fail."""

import re
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from cranectl.campaign.summary import CONFIDENCE, GroupSummary
from cranectl.support import InputError, JUnitCase

PERCENT = re.compile(r"\s*(\d{1,3}(?:\.\d{1,9})?)\s*%\s*")
NUMBER = re.compile(r"\s*\d{1,9}\s*")


class AllowedFailures(NamedTuple):
    """How many runs with one controller on one plant may fail: a number of them, or a share."""

    text: str  # as the user gives it
    number: int | None  # of runs; None for a share
    share: Fraction = Fraction(0)  # of runs, if no number is given

    def are_kept(self, failures: int, runs: int) -> bool:
        """Return True if no more runs failed; False without any run, which shows nothing."""
        allowed = self.share * runs if self.number is None else self.number
        return runs > 0 and failures <= allowed

    @staticmethod
    def parse(text: str) -> "AllowedFailures":
        """Read a number of runs, such as 2, or a share of them, such as 5%; raise InputError for others."""
        if NUMBER.fullmatch(text):
            return AllowedFailures(text.strip(), int(text))
        match = PERCENT.fullmatch(text)
        if match and (share := Fraction(match[1]) / 100) <= 1:
            return AllowedFailures(f"{match[1]} %", None, share)
        raise InputError(
            f"--max-failures {text}",
            allowed="a number of runs such as 2, or a share of them from 0% to 100% such as 5%",
            remedy="write --max-failures 5%",
        )


class FailureVerdict(NamedTuple):
    """Whether the failures of the runs with one controller on one plant are as many as allowed or fewer."""

    group: GroupSummary
    allowed: AllowedFailures
    kept: bool

    @property
    def name(self) -> str:
        """Controller and plant in words."""
        return f"{self.group.controller} on {self.group.plant}"

    @property
    def text(self) -> str:
        """How many runs failed, their share with its interval, and what is allowed."""
        group = self.group
        if not group.runs:
            return f"no run; at most {self.allowed.text} may fail"
        share = f"{group.failures} of {group.runs} failed: {percent(group.failures / group.runs)} %"
        if group.failure_rate_interval:
            low, high = map(percent, group.failure_rate_interval)
            share += f", {low} to {high} % (Wilson, {100 * CONFIDENCE:.0f} %)"
        return f"{share}; at most {self.allowed.text} may fail"

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        group = self.group
        return {
            "plant": group.plant,
            "controller": group.controller,
            "runs": group.runs,
            "failures": group.failures,
            "failure_rate": group.failure_rate,
            "failure_rate_interval": group.failure_rate_interval,
            "passed": self.kept,
        }


def judge_failures(groups: Sequence[GroupSummary], allowed: AllowedFailures) -> tuple[FailureVerdict, ...]:
    """Judge the runs with each controller on each plant; one that is good hides no other that is bad."""
    return tuple(
        FailureVerdict(group, allowed, allowed.are_kept(group.failures, group.runs)) for group in groups
    )


def failure_cases(
    verdicts: Sequence[FailureVerdict], campaign: str, notes: Sequence[Sequence[str]]
) -> list[JUnitCase]:
    """Return a test for each verdict; `notes` has further lines for each."""
    return [
        JUnitCase(
            campaign, v.name, "passed" if v.kept else "failed" if v.group.runs else "error", [v.text, *lines]
        )
        for v, lines in zip(verdicts, notes, strict=True)
    ]


def percent(share: float) -> str:
    """Return a share in percent, with a digit after the point below 10."""
    value = 100.0 * share
    text = f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"
    return text.removesuffix(".0")
