"""What all commands share: every place that they are to write to is checked before they begin."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from cranectl.places import Kind, check_place, kind_of


class OutputFile(click.Path):
    """The type of an option that names a file to write: of one kind, or of that which its ending names."""

    def __init__(
        self, kind: Kind | None = None, *, endings: tuple[str, ...] = (), dash: bool = False
    ) -> None:
        """`dash`: whether `-` is standard output."""
        super().__init__(path_type=None if dash else Path)
        self.kind, self.endings, self.dash = kind, endings, dash

    def kind_of(self, path: Path) -> Kind:
        """The kind of file to be written to `path`; raises InputError for an ending that names none."""
        return self.kind or kind_of(path, self.endings)


class Command(click.Command):
    """A command that never writes onto what it reads, nor twice to one place."""

    def invoke(self, context: click.Context) -> Any:
        outputs = list(_outputs(context))
        inputs = [path for name, value in context.params.items() for path in _named(value)]
        for option, kind, path in outputs:
            others = [path for name, _, path in outputs if name != option]
            own = [each for each in inputs if each is not path]
            check_place(path, kind, inputs=[*own, *others], option=option)
        return super().invoke(context)


def _outputs(context: click.Context) -> Iterator[tuple[str, Kind, Path]]:
    for parameter in context.command.params:
        given, kind = context.params.get(parameter.name or ""), parameter.type
        if isinstance(kind, OutputFile) and given is not None and not (kind.dash and given == "-"):
            yield parameter.opts[0], kind.kind_of(Path(given)), Path(given)


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
