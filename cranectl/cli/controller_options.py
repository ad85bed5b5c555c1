"""Options that name controllers, or files of controllers, which are run only because of these options."""

import functools
from collections.abc import Callable
from math import isnan
from pathlib import Path
from typing import Any

import click

from cranectl import loaders
from cranectl import scenario as scenario_files
from cranectl.cli.command import F
from cranectl.cli.completion import Completion
from cranectl.cli.names import Names
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.support import InputError


class ControllerName(click.ParamType):  # type: ignore[type-arg]
    """The type of an option that names a controller, or the file of one, which is opened."""

    name = "controller"

    def convert(self, value: str, _parameter: Any, context: click.Context | None) -> str:
        """Return the name of the controller; raise InputError for an empty name or a file without one."""
        if is_completing(context):
            return value
        if not value.strip():
            ALL_CONTROLLERS.checked(value)
        if "," in value and not Path(value).exists():
            raise InputError(
                f"several controllers: {value}",
                allowed="one controller, or its file",
                remedy=f"name one of them, or run all: cranectl validate SCENARIO --controller {value}",
            )
        return ControllerName.open(value)

    @staticmethod
    def open(name: str, directory: Path = Path()) -> str:
        """Return `name`, or the name of the controller in the file that it names, seen from `directory`."""
        if not {".", ":"} & set(name):
            return name
        if not ALL_CONTROLLERS.is_reference(name):
            loaders.check_compiled(directory / name)
            return name
        return loaders.open_controller(
            name if name.startswith(ALL_CONTROLLERS.UDP) else str(directory / name)
        )

    @staticmethod
    def open_own(scenario: "scenario_files.Scenario", source: str) -> str:
        """Return the name of the controller of `scenario`; if its file, `source`, names a file, open that."""
        return ControllerName.open(scenario.controller.name, scenario_files.ScenarioFile.find(source).parent)

    @staticmethod
    def option(function: F) -> F:
        """Add `--controller` and `--trust` to a command that takes `scenario`."""

        @click.option(
            "--controller",
            metavar="NAME",
            type=ControllerName(),
            shell_complete=Completion.controllers,
            help="A controller, or the file of one: law.py:NAME, law.so, law.fmu. "
            "Default: the scenario's own.",
        )
        @ControllerName.trust_option("SCENARIO")
        @functools.wraps(function)
        def command(*, trust: bool, controller: str | None, scenario: str, **options: Any) -> Any:
            if trust and controller is None:
                controller = ControllerName.open_own(scenario_files.ScenarioFile.read(scenario), scenario)
            return function(controller=controller, scenario=scenario, **options)

        return command  # type: ignore[return-value]

    @staticmethod
    def repeated_option(help_text: str, *, opens: bool = True) -> Callable[[F], F]:
        """Return `--controller`, which may be repeated; with `opens`, controllers in files are opened."""
        return click.option(
            "--controller",
            "--controllers",
            "controllers",
            metavar="NAME",
            multiple=True,
            shell_complete=Completion.controllers,
            callback=_opened_names if opens else Names.split,
            help=help_text,
        )

    @staticmethod
    def timeout_option(function: F) -> F:
        """Add `--timeout`."""
        return click.option(
            "--timeout",
            type=Seconds(),
            metavar="S",
            default=120.0,
            show_default=True,
            help="Seconds that a block of 1000 samples may take with the controller of a file.",
        )(function)

    @staticmethod
    def trust_option(document: str) -> Callable[[F], F]:
        """Return `--trust`."""
        return click.option(
            "--trust", is_flag=True, help=f"Run the code of a controller whose file {document} itself names."
        )


class Seconds(click.FloatRange):
    """The type of an option for a time to wait: positive, and no longer than a process can wait at once."""

    def __init__(self) -> None:
        super().__init__(min=0.0, min_open=True, max=1e6)

    def convert(self, value: Any, parameter: Any, context: Any) -> float:
        """Return the time [s]; refuse NaN, which passes any comparison with a bound, and other text."""
        seconds: float = super().convert(value, parameter, context)
        if isnan(seconds):
            self.fail(f"{value} is not in the range 0<x<=1000000.", parameter, context)
        return seconds


def is_completing(context: click.Context | None) -> bool:
    """Return True while a shell completes the command line, which must not run the code that it names."""
    return context is not None and context.resilient_parsing


def _opened_names(
    context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> tuple[str, ...]:
    names = Names.split(context, parameter, texts)
    return names if is_completing(context) else tuple(map(ControllerName.open, names))
