"""`cranectl new`."""

import re
from pathlib import Path

import click

from cranectl.cli.command import Command

TEMPLATES = Path(__file__).parent / "templates"
ENDINGS = {"scenario": "toml", "rig": "toml", "campaign": "toml", "controller": "py"}


@click.command("new", cls=Command)
@click.argument("kind", type=click.Choice(list(ENDINGS)))
@click.argument("name")
@click.option(
    "--in",
    "directory",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path(),
    help="Where to write. Default: here.",
)
def new_command(kind: str, name: str, directory: Path) -> None:
    """Write a small working example of a file, and its test.

    NAME is of lower case letters, digits and hyphens. Files that exist are never replaced. The test runs
    with pytest.

    \b
    cranectl new scenario first-move
    cranectl new controller servo --in controllers
    cranectl new rig yard-crane
    cranectl new campaign unknown-load
    """
    from cranectl.support.errors import InputError
    from cranectl.support.extensions import check_name
    from cranectl.support.files import exists, write_text, writing

    check_name(kind, name)
    module = name.replace("-", "_")
    stem = module if kind == "controller" else name
    files = {
        directory / f"{stem}.{ENDINGS[kind]}": f"{kind}.{ENDINGS[kind]}.txt",
        directory / f"test_{module}.py": f"test_{kind}.py.txt",
    }
    for path in files:
        if exists(path):
            raise InputError(
                f"{path} exists", allowed="a name that is free", remedy="choose another name, or another --in"
            )
    for path, template in files.items():
        text = (TEMPLATES / template).read_text(encoding="utf-8")
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, re.sub("NAME", name, re.sub("MODULE", module, text)))
        click.echo(f"written: {path}")
    click.echo(f"try it: python -m pytest {directory / f'test_{module}.py'}")
