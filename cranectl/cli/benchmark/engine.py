"""What runs the batches of a benchmark's pieces: threads here, or a cluster."""

from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cranectl.campaign.benchmark.running import Engine
    from cranectl.campaign.definition import Batch, Campaign
    from cranectl.campaign.table import Row
    from cranectl.campaign.worker import Stop

    Batches = Generator[tuple[Batch, list[Row]], None, None]


@contextmanager
def engine_of(scheduler: str | None, patience: float) -> Iterator["Engine"]:
    """One thread for each piece; with `scheduler` the workers of that cluster."""
    if scheduler is None:
        from cranectl.campaign.child_worker import Children
        from cranectl.campaign.workers import run_batches

        with Children() as children:

            def here(campaign: "Campaign", batches: "Sequence[Batch]", stop: "Stop") -> "Batches":
                return run_batches(campaign, batches, patience=patience, stop=stop, children=children)

            yield here
        return
    from cranectl.campaign.cluster import cluster_client, run_batches_on

    with cluster_client(scheduler, 1) as client:

        def there(campaign: "Campaign", batches: "Sequence[Batch]", stop: "Stop") -> "Batches":
            return run_batches_on(client, campaign, batches, stop)

        yield there
