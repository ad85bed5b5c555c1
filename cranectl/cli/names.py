"""Options that take several names: plants, labels of runs."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from cranectl.cli.completion import Completion
from cranectl.plants import PLANTS
from cranectl.support import InputError

F = TypeVar("F", bound=Callable[..., Any])


class Names:
    """The type of options that take several names, with commas between: plants and labels of runs."""

    @staticmethod
    def plants_option(help_text: str, *, check: str = "", of_logs: bool = False) -> Callable[[F], F]:
        """Return `--plants`: names with commas, or all; no name means what the command documents.

        `check`: a method of plants' entries that raises InputError for those that `all` leaves out.
        `of_logs`: names are as given, for `PLANTS.of_logs`: a log tells of plants only when it is read.
        """
        callback = Names.split if of_logs else functools.partial(_plants, check=check)
        named: dict[str, Any] = {"metavar": "A,B|all", "multiple": True, "callback": callback}
        return click.option(
            "--plants", "--plant", "plants", shell_complete=Completion.plants, help=help_text, **named
        )

    @staticmethod
    def split(_: click.Context, parameter: click.Parameter, texts: tuple[str, ...]) -> tuple[str, ...]:
        """Split names at commas, of an option that may be repeated; each name once."""
        names = [name.strip() for text in texts for name in text.split(",")]
        if not all(names):
            raise InputError(
                f"{parameter.opts[0]} {','.join(texts)}: a name is empty",
                allowed="a name, or names with a comma between",
                remedy="remove the comma that is too many",
            )
        return tuple(dict.fromkeys(names))

    @staticmethod
    def run_plants_option(function: F) -> F:
        """Add `--plants` to a command that runs a scenario on several plants."""
        help_text = "Or MJCF files. Default: analytic,elastic,mujoco."
        return Names.plants_option(help_text, check="check_installed")(function)

    @staticmethod
    def label_option(function: F) -> F:
        """Add `--label`, which names the runs of logs, one after the other."""
        return click.option(
            "--label",
            "labels",
            metavar="A,B",
            multiple=True,
            callback=Names.split,
            help="What the runs are called, one after the other. Default: as much of "
            "SCENARIO-CONTROLLER-DRIVE-PLANT as tells them apart, else the names of the files.",
        )(function)

    @staticmethod
    def of_files(files: Sequence[Path]) -> list[str]:
        """Return a name for each file: its stem, with as many directories as make it unique."""
        for depth in range(1, max(len(file.parts) for file in files) + 1):
            names = ["/".join((*file.parent.parts, file.stem)[-depth:]) for file in files]
            if len(set(names)) == len(names):
                return names
        return [f"{file.stem}-{k}" for k, file in enumerate(files, 1)]


def _plants(
    context: click.Context, parameter: click.Parameter, texts: tuple[str, ...], *, check: str
) -> tuple[str, ...]:
    names = Names.split(context, parameter, texts)
    if not names or context.resilient_parsing:
        return ()
    PLANTS.forget_model_files()  # those of an earlier command in this process
    named, able = tuple(PLANTS if names in PLANTS.ALL else (PLANTS.find(name).name for name in names)), []
    if names not in PLANTS.ALL:
        return named
    for name in named:
        try:
            if check:
                getattr(PLANTS[name], check)()
            able.append(name)
        except InputError as error:
            click.echo(f"cranectl: without {name}: {error.remedy}", err=True)
    return tuple(able)
