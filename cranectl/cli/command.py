"""What commands share: options, and that memory and every place to write to are checked before they begin."""

import functools
import shlex
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import click

from cranectl.support import FileKind, InputError

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
