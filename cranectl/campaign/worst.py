"""The runs that are worth a look: the largest errors, and an example of every way to stop."""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.results import Results
from cranectl.campaign.summary import MEASURE, worst_first
from cranectl.status import RunStatus

NUMBER = re.compile(r"[-+]?\d[-+.\de]*")  # reasons that differ in numbers only are one
MOST_STOPS = 8  # examples for each plant and controller


class Example(NamedTuple):
    """One run, and why it was chosen."""

    plant: str
    controller: str
    sample: int
    why: str
    status: str
    end_s: float
    max_error_m: float | None  # until it ended


def examples(results: Results, *, worst: int) -> tuple[Example, ...]:
    """For each plant and controller the `worst` runs, then the first run of every further way to stop."""
    settings = results.campaign.settings
    plants, controllers = results.column("plant"), results.column("controller")
    order = worst_first(results, MEASURE)
    found: list[Example] = []
    for plant in settings.plants:
        for controller in settings.controllers:
            chosen = (plants == plant) & (controllers == controller)
            rows = order[chosen[order]][:worst].tolist()
            found += [_example(results, row, "largest error") for row in rows]
            found += _stops(results, np.flatnonzero(chosen), rows)
    return tuple(found)


def _stops(results: Results, chosen: NDArray[np.intp], shown: Sequence[int]) -> Iterator[Example]:
    """One of every reason why some of the `chosen` rows stopped, unless one of it is `shown`."""
    status, reason = results.column("status"), results.column("reason")
    alike: dict[tuple[str, str], list[int]] = {}
    for row in chosen[status[chosen] != RunStatus.COMPLETED.label].tolist():
        alike.setdefault((status[row], NUMBER.sub("#", reason[row])), []).append(row)
    new = [rows for rows in alike.values() if not set(rows) & set(shown)]
    for rows in sorted(new, key=lambda rows: -len(rows))[:MOST_STOPS]:
        yield _example(results, rows[0], f"one of {len(rows)}: {reason[rows[0]]}")


def _example(results: Results, row: int, why: str) -> Example:
    run = results.row(row)
    return Example(
        plant=run["plant"],
        controller=run["controller"],
        sample=run["sample"],
        why=why,
        status=run["status"],
        end_s=run["end_s"],
        max_error_m=run["max_error_m"],
    )
