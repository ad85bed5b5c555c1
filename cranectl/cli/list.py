"""`cranectl list`."""

from typing import Any

import click

from cranectl.cli.command import Command, json_option
from cranectl.cli.output import Screen
from cranectl.cli.schema import schema_option
from cranectl.report.table import Table, cells


@click.command("list", cls=Command)
@schema_option
@json_option
def list_command(screen: Screen) -> None:
    """List scenarios, rigs, controllers, plants and drives.

    With --schema the keys of a kind of file. With `#:schema scenario.json` in the first line of a TOML file,
    editors that know TOML complete its keys, show what they mean and mark what is wrong. Metrics, plants and
    laws of installed packages are in it.

    \b
    cranectl list
    cranectl list --json -
    cranectl list --schema scenario > scenario.json
    """
    from cranectl.controllers.registry import described_controllers
    from cranectl.plants.plant import DRIVES
    from cranectl.plants.registry import PLANTS
    from cranectl.scenario import read_scenario, rig_names, scenario_names

    scenarios = [read_scenario(name) for name in scenario_names()]
    rows = tuple(cells(s.name, f"{s.duration:g} s", s.controller.name, s.title) for s in scenarios)
    screen.print(Table("Scenarios", ("name", "duration", "controller", "what it is"), rows, labels=4))
    laws = [(name, origin, title) for name, (origin, title) in described_controllers().items()]
    rows = tuple(cells(*law) for law in laws)
    screen.print(Table("Controllers", ("name", "from", "what it is"), rows, labels=3))
    registries: dict[str, tuple[str, ...]] = {
        "rigs": tuple(rig_names()),
        "plants": tuple(PLANTS),
        "drives": tuple(DRIVES),
    }
    for name, entries in registries.items():
        screen.print(f"{name:12} {', '.join(entries)}")
    listed: list[dict[str, Any]] = [
        scenario.model_dump(include={"name", "title", "duration", "controller"}) for scenario in scenarios
    ]
    told = {name: list(entries) for name, entries in registries.items()}
    screen.write_json({"scenarios": listed, "controllers": [name for name, *_ in laws], **told})
