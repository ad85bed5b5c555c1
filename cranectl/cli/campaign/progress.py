"""Progress of a campaign on a terminal: rates, failures, time left."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from cranectl.cli.screen import progress

if TYPE_CHECKING:
    from cranectl.campaign import Campaign
    from cranectl.campaign.definition import Batch
    from cranectl.campaign.table import Row

COLUMNS = (
    TextColumn("{task.description}"),
    BarColumn(),
    MofNCompleteColumn(),
    TextColumn("{task.fields[rates]}"),
    TimeRemainingColumn(),
)


@contextmanager
def campaign_progress(
    campaign: "Campaign", missing: Sequence["Batch"]
) -> Iterator[Callable[[Sequence["Row"]], None]]:
    """A bar on standard error over all runs; yields what to call with new rows. Silent if no terminal."""
    from cranectl.campaign.summary import row_failed

    settings = campaign.settings
    total = campaign.runs * len(settings.plants) * len(settings.controllers)
    there = total - sum(batch.last - batch.first for batch in missing)
    runs, failures, simulated, start = 0, 0, 0.0, monotonic()
    with progress(*COLUMNS) as shown:
        task = shown.add_task(settings.name, total=total, completed=there, rates="preparing")

        def advance(rows: Sequence["Row"]) -> None:
            nonlocal runs, failures, simulated
            runs += len(rows)
            failures += sum(row_failed(campaign, row) for row in rows)
            simulated += sum(float(row["end_s"] or 0.0) for row in rows)
            shown.update(task, advance=len(rows), rates=rates(runs, failures, simulated, monotonic() - start))

        yield advance


def rates(runs: int, failures: int, simulated: float, seconds: float) -> str:
    """What is said beside the bar; `simulated` [s] in `seconds` of waiting."""
    per_second = 1.0 / max(seconds, 1e-9)
    return f"{runs * per_second:.1f} runs/s, {simulated * per_second:.0f} s simulated/s, {failures} failed"
