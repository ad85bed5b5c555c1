"""What all runs of a campaign share: prepared once, read by all workers."""

import functools
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Campaign, nominal_scenario
from cranectl.campaign.sampling import sample_values
from cranectl.controllers.addressed import AddressedLaw
from cranectl.controllers.flat import Tracker
from cranectl.controllers.registry import controller_design
from cranectl.scenario import Scenario
from cranectl.simulate import PlannedReference, law_of, plan_reference
from cranectl.simulate.run import record_width

Array = NDArray[np.float64]

BLOCK = 8192  # samples drawn together: some methods take as long for one
PERIODS = 16  # control periods for which references and trackers are kept


@dataclass(frozen=True)
class Controller:
    """A controller as it runs on the crane that it knows."""

    nominal: Scenario
    reference: PlannedReference
    law: Tracker | AddressedLaw
    width: int  # columns of its record


class Prepared:
    """The controllers and their reference, both of the nominal crane, and the samples."""

    def __init__(self, campaign: Campaign, controllers: Sequence[str] | None = None) -> None:
        """`controllers`: by default those of the campaign. Raises InputError where one cannot be run."""
        self.campaign = campaign
        names = campaign.settings.controllers if controllers is None else controllers
        self._designs = {name: controller_design(name, campaign.nominal) for name in names}
        self._drawn = functools.lru_cache(maxsize=4)(self._draw)
        self._planned = functools.lru_cache(maxsize=PERIODS)(plan_reference)
        self._made = functools.lru_cache(maxsize=PERIODS * len(names))(self._make)
        self._lock = threading.Lock()
        for name in names:
            self._made(name, campaign.nominal)

    def controller(self, name: str, sampled: Scenario) -> Controller:
        """The controller `name`, made for the control period of a sample; raises InputError as above."""
        with self._lock:
            return self._made(name, nominal_scenario(self.campaign, sampled))

    def values(self, sample: int) -> Array:
        """Values (d,) of one sample."""
        with self._lock:
            row: Array = self._drawn(sample // BLOCK)[sample % BLOCK]
        return row

    def _draw(self, block: int) -> Array:
        first = block * BLOCK
        return sample_values(self.campaign, first, min(first + BLOCK, self.campaign.runs))

    def _make(self, name: str, nominal: Scenario) -> Controller:
        design, planned = self._designs[name], self._planned(nominal)
        law = law_of(nominal, design, self.campaign.settings.drive, planned)
        return Controller(nominal, planned, law, record_width(design))
