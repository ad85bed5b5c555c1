"""`cranectl compare`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli.options import json_option

if TYPE_CHECKING:
    from cranectl.simulate import Run


@click.command("compare")
@click.argument("logs", metavar="LOG [LOG]", nargs=-1, required=True, type=click.Path(path_type=Path))
@json_option
def compare_command(logs: tuple[Path, ...], json_file: str | None) -> None:
    """Compare the two plants of one LOG, or the same plants of two LOGs.

    \b
    cranectl compare logs/fixed-position/lqr-ideal.mcap
    cranectl compare logs/fixed-position/lqr-ideal.mcap logs/fixed-position/lqr-velocity.mcap
    """
    from cranectl.cli.output import comparison_table, console, write_json
    from cranectl.compare import compare_runs

    comparisons = [compare_runs(a, b) for a, b in _pairs(logs)]
    screen = console(json_file)
    for comparison in comparisons:
        screen.print(comparison_table(comparison))
        screen.print(
            f"loads at most {comparison.max_load_error_m:.3e} m apart, "
            f"at {comparison.max_load_error_at_s:g} s; "
            f"angles {comparison.max_angle_error_rad:.3e} rad; {comparison.samples} common samples",
            soft_wrap=True,
        )
        if not comparison.same_length:
            screen.print("[yellow]the runs did not end at the same time[/]")
    write_json(json_file, {"comparisons": [comparison.to_json() for comparison in comparisons]})


def _pairs(logs: tuple[Path, ...]) -> list[tuple["Run", "Run"]]:
    """The runs to compare: the plants of one log, or each plant that two logs share."""
    from cranectl.errors import InputError
    from cranectl.log import read_log

    if len(logs) > 2:
        raise InputError(f"{len(logs)} logs", allowed="one log or two", remedy="compare them two by two")
    runs = [read_log(log) for log in logs]
    if len(runs) == 1:
        plants = list(runs[0].values())
        if len(plants) != 2:
            raise InputError(
                f"{logs[0]} holds the run of one plant only",
                allowed="a log of both plants, or two logs",
                remedy="run with --plant both, or name a second log",
            )
        return [(plants[0], plants[1])]
    shared = [plant for plant in runs[0] if plant in runs[1]]
    if shared:
        return [(runs[0][plant], runs[1][plant]) for plant in shared]
    if len(runs[0]) == len(runs[1]) == 1:
        return [(next(iter(runs[0].values())), next(iter(runs[1].values())))]
    raise InputError("the logs share no plant", allowed="logs of the same plant")
