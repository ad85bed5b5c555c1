"""What all runs of a campaign share: prepared once, read by all workers."""

import functools
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Campaign
from cranectl.campaign.sampling import sample_values
from cranectl.design import design_controller
from cranectl.simulate import PlannedReference, plan_reference, tracker_of
from cranectl.simulate.runner import record_width
from cranectl.tracker import Tracker

Array = NDArray[np.float64]

BLOCK = 8192  # samples drawn together: some methods take as long for one


@dataclass(frozen=True)
class Controller:
    """A controller as it runs on the nominal crane."""

    tracker: Tracker
    width: int  # columns of its record


class Prepared:
    """The controllers and the reference, both of the nominal crane, and the samples."""

    def __init__(self, campaign: Campaign, controllers: Sequence[str] | None = None) -> None:
        """`controllers`: by default those of the campaign. Raises InputError where one cannot be run."""
        self.campaign = campaign
        self.reference: PlannedReference = plan_reference(campaign.nominal)
        names = campaign.settings.controllers if controllers is None else controllers
        self.controllers = {name: _controller(campaign, name) for name in names}
        self._drawn = functools.lru_cache(maxsize=4)(self._draw)
        self._lock = threading.Lock()

    def values(self, sample: int) -> Array:
        """Values (d,) of one sample."""
        with self._lock:
            row: Array = self._drawn(sample // BLOCK)[sample % BLOCK]
        return row

    def _draw(self, block: int) -> Array:
        first = block * BLOCK
        return sample_values(self.campaign, first, min(first + BLOCK, self.campaign.runs))


def _controller(campaign: Campaign, name: str) -> Controller:
    design = design_controller(name, campaign.nominal.design)
    return Controller(tracker_of(campaign.nominal, design), record_width(design))
