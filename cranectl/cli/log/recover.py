"""`cranectl log recover`."""

from pathlib import Path

import click

from cranectl.cli.command import Command
from cranectl.cli.options import json_option, output_option
from cranectl.support.files import MCAP


@click.command("recover", cls=Command)
@click.argument("file", metavar="FILE", type=click.Path(path_type=Path))
@output_option("--out", MCAP, "Log file. Default: the place the log should have had, if it is free")
@json_option
def recover_log_command(file: Path, out: Path | None, json_file: str | None) -> None:
    """Save what is whole in FILE, a log that was cut off.

    Its process was killed, or its disk full. At most the last chunk of 64 KiB is missing.
    FILE itself stays as it is.

    \b
    cranectl log recover logs/fixed-position/lqr-ideal.mcap.4711.part
    """
    from cranectl.cli.output import console, write_json
    from cranectl.log import recover_log

    recovery = recover_log(file, out)
    screen = console(json_file)
    screen.print(f"{recovery.messages} messages of {file} are whole")
    for run in recovery.runs:
        expected = f" of {run.expected}" if run.expected is not None else ""
        screen.print(f"  {run.plant}: {run.status} at {run.end_s:g} s, {run.samples}{expected} samples")
    if recovery.lost:
        screen.print(f"  the last {recovery.lost} of {recovery.size} bytes are no whole chunk, and lost")
    screen.print(f"log: {recovery.log}")
    write_json(json_file, recovery.to_json())
