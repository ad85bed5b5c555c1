"""The scenarios that there are."""

from collections.abc import Sequence

from cranectl.report.table import Cell, Table
from cranectl.scenario import Scenario


def scenario_table(scenarios: Sequence[Scenario]) -> Table:
    """One row a scenario."""
    rows = tuple(
        tuple(map(Cell, (each.name, f"{each.duration:g} s", each.controller, each.title)))
        for each in scenarios
    )
    return Table("Scenarios", ("name", "duration", "controller", "what it is"), rows, labels=4)
