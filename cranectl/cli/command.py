"""What all commands share: memory and every place to write to are checked before they begin."""

from pathlib import Path
from typing import Any

import click

from cranectl.support.errors import InputError
from cranectl.support.files import Kind, check_place, kind_of

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

LEAST_MEMORY = 10**9  # [bytes]; a run takes 850 MB of addresses


class OutputFile(click.Path):
    """The type of an option that names a file to write: of one kind, or of that which its ending names."""

    def __init__(
        self, kind: Kind | None = None, *, endings: tuple[str, ...] = (), dash: bool = False
    ) -> None:
        """`dash`: whether `-` is standard output."""
        super().__init__(path_type=None if dash else Path)
        self.kind, self.endings, self.dash = kind, endings, dash

    def to_stdout(self, value: Any) -> bool:
        """Whether `value` stands for standard output."""
        return self.dash and str(value) == "-"

    def kind_of(self, path: Path) -> Kind:
        """The kind of file to be written to `path`; raises InputError for an ending that names none."""
        return self.kind or kind_of(path, self.endings)


class Command(click.Command):
    """A command that never writes onto what it reads, nor twice to one place."""

    def invoke(self, context: click.Context) -> Any:
        _check_memory()
        given = [(each, context.params.get(each.name or "")) for each in context.command.params]
        inputs = [
            path for each, value in given if not isinstance(each.type, OutputFile) for path in _named(value)
        ]
        outputs = [
            (each.opts[0], each.type, Path(value))
            for each, value in given
            if isinstance(each.type, OutputFile) and value is not None and not each.type.to_stdout(value)
        ]
        for option, to, path in outputs:
            others = [other for that, _, other in outputs if that != option]
            check_place(path, to.kind_of(path), inputs=[*inputs, *others], option=option)
        return super().invoke(context)


class Group(click.Group):
    """Commands in the order in which one uses them."""

    def list_commands(self, _context: click.Context) -> list[str]:
        return list(self.commands)


def _check_memory() -> None:
    """Raise InputError where a limit leaves too little: the linear algebra library would wait for ever."""
    if resource is None:
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < LEAST_MEMORY:
        raise InputError(
            f"this process may have {limit / 1e6:.0f} MB of address space",
            allowed=f"at least {LEAST_MEMORY / 1e6:.0f} MB",
            remedy="raise the limit, for example with ulimit -v unlimited",
        )


def _named(value: Any) -> list[Path]:
    """The files that the value of a parameter names, or could name."""
    values = value if isinstance(value, tuple) else (value,)
    return [path for path in map(_file, values) if path is not None]


def _file(value: Any) -> Path | None:
    if not isinstance(value, str | Path):
        return None
    path = Path(value)
    try:
        return path if path.is_file() else None
    except (OSError, ValueError):  # no name of a file
        return None
