"""What a log says of its runs beside their signals: scenario, design, plants, outcomes."""

from collections.abc import Mapping
from dataclasses import dataclass

from cranectl.controllers.controller import LawDesign
from cranectl.design import Design
from cranectl.log import topics
from cranectl.log.consistency import Clock, Outcome
from cranectl.mcap_columns.records import DamageError
from cranectl.plants.plant import Drive
from cranectl.scenario import Scenario
from cranectl.signals import REFERENCE, SignalGroup
from cranectl.simulate import groups_of


@dataclass(frozen=True)
class LogHeader:
    """The metadata and attachments of a log, understood."""

    scenario: Scenario
    design: Design | LawDesign
    drive: Drive
    every: int  # logged every n-th control sample
    models: Mapping[str, str]  # the plants' own descriptions, by plant
    versions: Mapping[str, str]
    outcomes: Mapping[str, Outcome]  # by plant, where known
    from_ns: int | None  # where a segment of a live session begins

    @property
    def plants(self) -> tuple[str, ...]:
        """In the order of the log."""
        return tuple(self.models)

    @property
    def clock(self) -> Clock:
        """When its runs have samples."""
        return Clock.of(self.scenario, self.every, self.from_ns)

    def outcome(self, plant: str) -> Outcome:
        """How the run of `plant` ended; raises DamageError if that is missing."""
        if plant not in self.outcomes:
            raise DamageError(f"it does not say how the run of {plant} ended")
        return self.outcomes[plant]

    def groups(self) -> dict[str, SignalGroup]:
        """The groups of signals that make up the runs, by topic."""
        recorded = groups_of(self.scenario, self.design, self.drive)
        groups = {topics.plant_topic(plant, group.name): group for plant in self.plants for group in recorded}
        return {**groups, topics.REFERENCE_LOAD: REFERENCE}
