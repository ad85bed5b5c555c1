"""The scenario that a command is asked for, and the options that many commands have for it."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from cranectl import planning
from cranectl import scenario as scenario_files
from cranectl.cli.command import Command, F
from cranectl.cli.completion import Completion
from cranectl.cli.output import Screen

if TYPE_CHECKING:
    from cranectl.scenario import Scenario


class ScenarioRequest(NamedTuple):
    """A scenario as a command is asked for it."""

    source: str | None  # its name or file; None: the default one
    rig: str | Path | None
    overrides: Sequence[str]

    def read(self) -> "Scenario":
        """Return the scenario as it is written; raises InputError."""
        return scenario_files.ScenarioFile.read(self.source, rig=self.rig, overrides=self.overrides)

    def load(self) -> "Scenario":
        """Return the scenario with its motions planned; raises InputError."""
        if self.source is None:
            return self.read()
        scenario = planning.load_scenario(self.source, rig=self.rig, overrides=self.overrides)
        _warn_of_masses(scenario)
        return scenario

    def having(self, *overrides: str) -> "ScenarioRequest":
        """Return the same with more overrides."""
        return self._replace(overrides=(*self.overrides, *overrides))

    @staticmethod
    def argument(function: F) -> F:
        """Add the argument `scenario`, which names a scenario or its file."""
        return click.argument("scenario", shell_complete=Completion.scenarios)(function)

    @staticmethod
    def options(function: F) -> F:
        """Add `--rig` and `--set`; the command gets both, and its scenario if any, as `request`."""

        @click.option(
            "--rig",
            metavar="FILE",
            type=Command.PATH,
            shell_complete=Completion.rigs,
            help="Name or TOML file of a rig, in place of the scenario's.",
        )
        @click.option(
            "--set",
            "overrides",
            metavar="KEY=VALUE",
            multiple=True,
            help="Override any field of the scenario, e.g. rig.load_mass=2.5; repeatable.",
        )
        @functools.wraps(function)
        def command(
            *, rig: Path | None, overrides: tuple[str, ...], scenario: str | None = None, **options: Any
        ) -> Any:
            return function(request=ScenarioRequest(scenario, rig, overrides), **options)

        return command  # type: ignore[return-value]

    @staticmethod
    def every_option(function: F) -> F:
        """Add `--every`, of a command with `options`, which gets it as an override."""

        @click.option(
            "--every", type=int, metavar="N", help="Log every N-th control sample (1: all of them)."
        )
        @functools.wraps(function)
        def command(*, every: int | None, request: ScenarioRequest, **options: Any) -> Any:
            changed = request if every is None else request.having(f"log.every={every}")
            return function(request=changed, **options)

        return command  # type: ignore[return-value]

    @staticmethod
    def drive_option(*, default: str, force: bool = True) -> Callable[[F], F]:
        """Return `--drive`; with `force` the command takes force drives too."""
        forces = "; force: forces on bridge, trolley, winch" if force else ""
        both = "; both: ideal and velocity; all" if default == "both" else ""
        return click.option(
            "--drive",
            default=default,
            show_default=True,
            metavar="NAME",
            shell_complete=Completion.drives,
            help="ideal: accelerations realised exactly; velocity: first-order drives with set-points"
            f"{forces}{both}.",
        )


def _warn_of_masses(scenario: "Scenario") -> None:
    """Warn once in a command, on standard error, if masses of a crane are implausible."""
    context = click.get_current_context(silent=True)
    printed = context.meta.setdefault("cranectl.warnings", set()) if context else set()
    warning = scenario.rig.mass_warning
    if warning and (scenario.name, warning) not in printed:
        printed.add((scenario.name, warning))
        Screen(stderr=True).print(Screen.styled(f"{scenario.name}: {warning}", "yellow"))
