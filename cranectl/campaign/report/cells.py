"""Texts in the tables of a campaign."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cranectl.campaign.definition import UncertainParameter
from cranectl.campaign.settings import INDEPENDENT
from cranectl.campaign.summary import CONFIDENCE
from cranectl.support import Array

LISTED = 12  # sample indices in a cell


class CellText:
    """Texts of cells of the tables of a campaign."""

    @staticmethod
    def distribution(parameter: UncertainParameter) -> str:
        """Return kind and numbers of the distribution of a parameter as text."""
        facts: dict[str, Any] = parameter.distribution.model_dump(exclude_none=True)
        kind, relative = facts.pop("distribution"), facts.pop("relative")
        text = ", ".join(f"{key} {CellText.short(value)}" for key, value in facts.items() if value != ())
        return f"{kind}: {text}{', times the nominal value' if relative else ''}".rstrip(": ")

    @staticmethod
    def short(value: Any) -> str:
        """Return a number in short, or those of a list with spaces between."""
        if isinstance(value, tuple | list):
            return " ".join(map(CellText.short, value))
        return f"{value:g}" if isinstance(value, float) else str(value)

    @staticmethod
    def ends(values: Array) -> tuple[float | None, float | None]:
        """Return the least and the largest finite value, or None."""
        there = values[np.isfinite(values)]
        return (there.min(), there.max()) if there.size else (None, None)

    @staticmethod
    def tested(p: float, tests: int, sampling: str, better: str) -> tuple[str, str]:
        """Return a p-value corrected for `tests`, and the better one if it is significant."""
        if sampling not in INDEPENDENT:
            return "–", "–"
        corrected = min(1.0, p * tests)
        text = "< 0.001" if corrected < 1e-3 else f"{corrected:.3f}"
        return text, better if corrected < 1.0 - CONFIDENCE else "–"

    @staticmethod
    def samples(samples: Sequence[int]) -> str:
        """Return sample indices as text, at most LISTED of them."""
        shown = ", ".join(map(str, samples[:LISTED]))
        return f"{shown} and {len(samples) - LISTED} more" if len(samples) > LISTED else shown or "none"
