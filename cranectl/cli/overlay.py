"""`cranectl log overlay`."""

import shlex
from pathlib import Path

import click

from cranectl.cli.command import PATH, Command, json_option, label_option, output_option, plants_option
from cranectl.cli.output import Screen, styled
from cranectl.support.errors import InputError
from cranectl.support.files import MCAP, check_place


@click.command("overlay", cls=Command)
@click.argument("logs", metavar="LOG LOG...", nargs=-1, required=True, type=PATH)
@output_option("--out", MCAP, "Log of all. Default: logs/SCENARIO/overlay.mcap")
@label_option
@plants_option("Whose runs to take of each LOG. Default: MuJoCo's.", of_logs=True)
@json_option
def overlay_command(
    logs: tuple[Path, ...],
    out: Path | None,
    labels: tuple[str, ...],
    plants: tuple[str, ...],
    screen: Screen,
) -> None:
    """Lay the runs of several LOGs on top of each other, in one log.

    Of several controllers, drives, rigs or settings. The first is the crane, the others are its ghosts;
    topics have the label of their run in front, as /lqr/load. `info`, `compare`, `report`, `render` and
    `log export` read such a log too.

    \b
    cranectl log overlay logs/fixed-position/lqr-ideal.mcap logs/fixed-position/pole-placement-ideal.mcap
    cranectl log overlay stiff.mcap soft.mcap --label stiff,soft --out both.mcap
    """
    from cranectl.cases.places import LOG_DIRECTORY
    from cranectl.compare.runs import against_first
    from cranectl.log.overlay import gathered, write_overlay
    from cranectl.report.run.differences import distances_table

    layers = gathered(logs, labels=labels, plants=plants)
    runs = {label: layer.run for label, layer in layers.items()}
    if len(runs) < 2:
        raise InputError(
            f"{logs[0]} alone, of which one run is taken",
            allowed="two runs or more",
            remedy="name another log, or the plants of this one with --plants all",
        )
    path = out or LOG_DIRECTORY / next(iter(runs.values())).scenario.name / "overlay.mcap"
    check_place(path, MCAP, inputs=logs, option="--out")
    comparisons = against_first(runs)
    write_overlay(path, layers)
    scenarios = dict.fromkeys(run.scenario.name for run in runs.values())
    if len(scenarios) > 1:
        screen.print(styled(f"scenarios differ: {', '.join(scenarios)}", "yellow"))
    screen.print(distances_table(next(iter(runs)), comparisons))
    screen.print(f"log: {path}")
    screen.print(f"view: cranectl log layout overlay view.json --log {shlex.quote(str(path))}")
    compared = [comparison.to_json() for comparison in comparisons.values()]
    screen.write_json({"log": str(path), "labels": [*runs], "comparisons": compared})
