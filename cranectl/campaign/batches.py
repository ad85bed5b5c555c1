"""The parts in which a campaign is run and kept: decided by the campaign alone, not by who runs it."""

from typing import NamedTuple

from cranectl.campaign.definition import Campaign

LEAST = 16  # samples of a batch: what a kill can cost each worker
MOST_BATCHES = 1024  # of one plant and controller; more would be many small files


class Batch(NamedTuple):
    """Samples [first, last) with one controller on one plant."""

    plant: str
    controller: str
    first: int
    last: int


def batches_of(campaign: Campaign) -> list[Batch]:
    """All batches of `campaign`, by plant, controller and sample."""
    settings, runs = campaign.settings, campaign.runs
    size = max(LEAST, -(-runs // MOST_BATCHES))
    return [
        Batch(plant, controller, first, min(first + size, runs))
        for plant in settings.plants
        for controller in settings.controllers
        for first in range(0, runs, size)
    ]
