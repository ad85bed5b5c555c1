"""Which software made the runs of a result, beside what is installed."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cranectl.campaign.manifest import software_of
from cranectl.campaign.results import Results
from cranectl.support.provenance import provenance_differences


@dataclass(frozen=True)
class Maker:
    """One set of sources, models, data and versions that made runs."""

    runs: int
    versions: dict[str, str]
    differences: tuple[str, ...]  # from what is installed, a phrase each

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def makers(results: Results) -> tuple[Maker, ...]:
    """What made the runs, the one that began the result first; nothing where there are no runs."""
    installed = software_of(results.campaign.settings.plants)
    counts = np.bincount(results.made_by, minlength=len(results.origins)).tolist()
    return tuple(
        Maker(count, dict(versions), tuple(provenance_differences(versions, installed)))
        for (_, versions), count in zip(results.origins, counts, strict=True)
        if count
    )


def software_notes(results: Results) -> list[str]:
    """What is to be said of it, a line each; nothing where all runs are by what is installed."""
    found = makers(results)
    runs = [f"{maker.runs} {'run' if maker.runs == 1 else 'runs'}" for maker in found]
    mixed = [f"made by {len(found)} sets of sources or versions: {', '.join(runs)}"] if len(found) > 1 else []
    others = [
        f"{count} by other software than what is installed: {'; '.join(maker.differences)}"
        for maker, count in zip(found, runs, strict=True)
        if maker.differences
    ]
    return mixed + others
