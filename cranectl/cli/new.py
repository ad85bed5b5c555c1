"""`cranectl new`."""

import re
import shlex
from collections.abc import Mapping
from pathlib import Path

import click

from cranectl.cli.command import PATH, Command
from cranectl.support.errors import InputError
from cranectl.support.files import exists, write_text, writing

MAP = "map"  # of measured files; NAME is such a file
TEMPLATES = Path(__file__).parent / "templates"
ENDINGS = {
    "scenario": "toml",
    "rig": "toml",
    "campaign": "toml",
    "controller": "py",
    "c-controller": "c",
    "generated-controller": "c",
}


@click.command("new", cls=Command)
@click.argument("kind", type=click.Choice([*ENDINGS, MAP]))
@click.argument("name")
@click.option(
    "--in", "directory", metavar="DIR", type=PATH, default=Path(), help="Where to write. Default: here."
)
def new_command(kind: str, name: str, directory: Path) -> None:
    """Write a small working example of a file, with its test.

    NAME has lower case letters, digits and hyphens. Existing files are never replaced. The test runs
    with pytest. A controller in C comes with the header of its interface, cranectl.h.

    \b
    cranectl new scenario first-move
    cranectl new controller servo --in controllers
    cranectl new c-controller servo
    cranectl new generated-controller embedded
    cranectl new rig yard-crane
    cranectl new campaign unknown-load

    For a map of measured columns NAME is a measured file; the map suggests what its columns may be:

    \b
    cranectl new map monday.csv
    """
    if kind == MAP:
        from cranectl.measured.suggestion import suggest_map

        _write({directory / f"{Path(name).stem}-map.toml": suggest_map(Path(name))})
        return
    from cranectl.loaders.c_law import HEADER, compile_command
    from cranectl.support.extensions import check_name

    check_name(kind, name)
    module = name.replace("-", "_")
    stem = module if kind.endswith("controller") else name
    templates = {
        f"{stem}.{ENDINGS[kind]}": TEMPLATES / f"{kind}.{ENDINGS[kind]}.txt",
        f"test_{module}.py": TEMPLATES / f"test_{kind}.py.txt",
        **({HEADER.name: HEADER} if ENDINGS[kind] == "c" else {}),
    }
    texts = {
        directory / file: re.sub("NAME", name, re.sub("MODULE", module, template.read_text(encoding="utf-8")))
        for file, template in templates.items()
    }
    _write(texts, shared=HEADER.name)
    if ENDINGS[kind] == "c":
        source = directory / f"{stem}.c"
        click.echo(f"compile it: {compile_command(source)}")
        library = shlex.quote(str(source.with_suffix(".so")))
        click.echo(f"run it: cranectl run fast-diagonal --controller {library}")
    click.echo(f"try it: python -m pytest {shlex.quote(str(directory / f'test_{module}.py'))}")


def _write(texts: Mapping[Path, str], *, shared: str = "") -> None:
    """Write new files; raise InputError if one exists, but for the file `shared` with the same text."""
    for path, text in texts.items():
        same = path.name == shared and path.is_file() and path.read_text(encoding="utf-8") == text
        if exists(path) and not same:
            raise InputError(
                f"{path} exists", allowed="a name that is free", remedy="choose another name, or another --in"
            )
    for path, text in texts.items():
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, text)
        click.echo(f"written: {path}")
