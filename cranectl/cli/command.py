"""What commands share: options, and that memory and every place to write to are checked before they begin."""

import functools
import shlex
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from cranectl.cli.completion import Completion
from cranectl.support import FileKind, InputError

if TYPE_CHECKING:
    from cranectl.scenario import Scenario

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

MIN_ADDRESS_SPACE = 10**9  # [bytes]; a run takes 850 MB of addresses

F = TypeVar("F", bound=Callable[..., Any])


class Invocation(NamedTuple):
    """The command line; the object of click's contexts."""

    arguments: tuple[str, ...]  # as typed, without `--traceback`
    full_traceback: bool


class OutputFile(click.Path):
    """The type of an option that names a file to write: of one kind, or of that which its ending names."""

    def __init__(
        self, kind: FileKind | None = None, *, endings: tuple[str, ...] = (), dash: bool = False
    ) -> None:
        """Make the type of a file to write; with `dash`, `-` is standard output."""
        super().__init__(path_type=None if dash else Path)
        self.kind, self.endings, self.dash = kind, endings, dash


class Command(click.Command):
    """A command that never writes onto what it reads, nor twice to one place; options that many have."""

    PATH = click.Path(path_type=Path)

    def invoke(self, context: click.Context) -> Any:
        _check_memory()
        values = [(param, context.params.get(param.name or "")) for param in context.command.params]
        inputs = [
            path
            for parameter, value in values
            if not isinstance(parameter.type, OutputFile)
            for path in _files(value)
        ]
        outputs = [
            (parameter.opts[0], parameter.type, Path(value))
            for parameter, value in values
            if isinstance(parameter.type, OutputFile) and value is not None
            if not (parameter.type.dash and value == "-")
        ]
        for option, to, path in outputs:
            others = [other for that, _, other in outputs if that != option]
            kind = to.kind or FileKind.of(path, to.endings)
            kind.check_place(path, inputs=[*inputs, *others], option=option)
        return super().invoke(context)

    @staticmethod
    def arguments() -> tuple[str, ...]:
        """Return the arguments of the present command as they were typed."""
        invocation = click.get_current_context().find_object(Invocation)
        return invocation.arguments if invocation else ()

    @staticmethod
    def given() -> str:
        """Return the present command as it was typed, quoted for a shell."""
        return shlex.join(["cranectl", *Command.arguments()])

    @staticmethod
    def json_option(function: F) -> F:
        """Add `--json`; the command gets a `screen` that prints, and writes JSON where requested."""

        @click.option(
            "--json",
            "json_file",
            metavar="FILE",
            type=OutputFile(FileKind.JSON, dash=True),
            help="Write the result as JSON; - is standard output, tables then go to standard error.",
        )
        @functools.wraps(function)
        def command(*args: Any, json_file: str | None, **options: Any) -> Any:
            from cranectl.cli.output import Screen

            return function(*args, screen=Screen(json_file), **options)

        return command  # type: ignore[return-value]

    @staticmethod
    def output_option(
        name: str, kind: FileKind | None, help_text: str, *, endings: tuple[str, ...] = ()
    ) -> Callable[[F], F]:
        """Return an option for a file to write, of one kind or of the kind that its ending names."""
        return click.option(name, metavar="FILE", type=OutputFile(kind, endings=endings), help=help_text)

    @staticmethod
    def directory_option(name: str, help_text: str, **more: Any) -> Callable[[F], F]:
        """Return an option for a directory."""
        return click.option(name, metavar="DIR", type=Command.PATH, help=help_text, **more)


class CommandGroup(click.Group):
    """Commands in the order in which one uses them."""

    def list_commands(self, _context: click.Context) -> list[str]:
        return list(self.commands)


def _check_memory() -> None:
    """Raise InputError where a limit leaves too little: the linear algebra library would wait for ever."""
    if resource is None:
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < MIN_ADDRESS_SPACE:
        raise InputError(
            f"this process may have {limit / 1e6:.0f} MB of address space",
            allowed=f"at least {MIN_ADDRESS_SPACE / 1e6:.0f} MB",
            remedy="raise the limit, for example with ulimit -v unlimited",
        )


def _files(value: Any) -> list[Path]:
    """Return the files that the value of a parameter names, or could name."""
    files = []
    for item in value if isinstance(value, tuple) else (value,):
        with suppress(OSError, ValueError):  # no name of a file
            if isinstance(item, str | Path) and Path(item).is_file():
                files.append(Path(item))
    return files


class ScenarioRequest(NamedTuple):
    """A scenario as a command is asked for it."""

    source: str | None  # its name or file; None: the default one
    rig: str | Path | None
    overrides: Sequence[str]

    def read(self) -> "Scenario":
        """Return the scenario as it is written; raises InputError."""
        from cranectl.scenario import ScenarioFile

        return ScenarioFile.read(self.source, rig=self.rig, overrides=self.overrides)

    def load(self) -> "Scenario":
        """Return the scenario with its motions planned; raises InputError."""
        from cranectl.planning import load_scenario

        if self.source is None:
            return self.read()
        scenario = load_scenario(self.source, rig=self.rig, overrides=self.overrides)
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
    from cranectl.cli.output import Screen

    context = click.get_current_context(silent=True)
    printed = context.meta.setdefault("cranectl.warnings", set()) if context else set()
    warning = scenario.rig.mass_warning
    if warning and (scenario.name, warning) not in printed:
        printed.add((scenario.name, warning))
        Screen(stderr=True).print(Screen.styled(f"{scenario.name}: {warning}", "yellow"))
