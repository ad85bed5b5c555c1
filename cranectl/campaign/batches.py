"""The parts in which a campaign is run and kept: decided by the campaign alone, not by who runs it."""

from typing import NamedTuple

from cranectl.campaign.definition import Campaign

# Samples of a batch, what a kill can cost each worker: on either plant some seconds of runs like those of the
# thesis, so that handing a batch to a cluster costs less than 2 % of it.
LEAST = {"mujoco": 16, "analytic": 64}
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
    sizes = {plant: max(LEAST[plant], -(-runs // MOST_BATCHES)) for plant in settings.plants}
    return [
        Batch(plant, controller, first, min(first + sizes[plant], runs))
        for plant in settings.plants
        for controller in settings.controllers
        for first in range(0, runs, sizes[plant])
    ]
