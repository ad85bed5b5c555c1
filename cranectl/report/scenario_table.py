"""The scenarios that there are."""

from collections.abc import Sequence

from cranectl.report.table import Table, cells
from cranectl.scenario import Scenario


def scenario_table(scenarios: Sequence[Scenario]) -> Table:
    """One row a scenario."""
    rows = tuple(cells(each.name, f"{each.duration:g} s", each.controller, each.title) for each in scenarios)
    return Table("Scenarios", ("name", "duration", "controller", "what it is"), rows, labels=4)
