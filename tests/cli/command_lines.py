"""All commands, and a quick command line of each, for tests that try odd options and arguments."""

from collections.abc import Iterator

import click

from cranectl.cli.main import cli

# What follows each command in a line that is quick, or is quickly refused where one of its parts is odd.
LINES = {
    "benchmark run": "--controller lqr-integral",
    "benchmark report": "nothing.csv",
    "campaign list": "",
    "campaign show": "many.toml",
    "campaign run": "many.toml --out other",
    "campaign report": "result",
    "campaign replay": "result",
    "certify": "lqr --scenario short.toml --hoisting-speed 0 --rope-length 0.7 --tilt 0 0",
    "compare": "one.mcap",
    "design": "lqr --scenario short.toml",
    "identify": "one.mcap --rig lab-rig",
    "info": "one.mcap",
    "ladder": "short.toml --controller lqr",
    "list": "",
    "live": "short.toml --plants analytic",
    "log import": "one.csv --map one.toml",
    "log export": "one.mcap --format csv --out csv",
    "log layout": "single view.json",
    "log overlay": "one.mcap one.mcap --out over.mcap",
    "log recover": "one.mcap --out recovered.mcap",
    "new": "rig yard",
    "plan": "short.toml",
    "render": "one.mcap one.png",
    "report": "one.mcap --out page.html",
    "run": "short.toml --plants analytic --out own.mcap",
    "thesis": "--json thesis.json",
    "tune": "lqr-integral",
    "validate": "short.toml --plants analytic --controller lqr --jobs 1",
}


def commands(command: click.Command = cli, path: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """Yield each command by its name."""
    if isinstance(command, click.Group):
        for name, part in command.commands.items():
            yield from commands(part, (*path, name))
    else:
        yield " ".join(path), command
