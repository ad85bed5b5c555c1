"""How long a campaign takes here, from a few runs of it."""

from time import perf_counter

from cranectl.campaign.batches import Batch
from cranectl.campaign.definition import Campaign
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.worker import Worker


def estimated_seconds(campaign: Campaign, *, workers: int) -> float:
    """Time of all runs on `workers` cores [s], from the first sample with each controller on each plant.

    It is run once before it counts, which loads and compiles.
    """
    settings = campaign.settings
    worker = Worker(Prepared(campaign, settings.controllers))
    total = 0.0
    for plant in settings.plants:
        for controller in settings.controllers:
            batch = Batch(plant, controller, 0, 1)
            worker.run_batch(batch)
            start = perf_counter()
            worker.run_batch(batch)
            total += perf_counter() - start
    return total * campaign.runs / workers
