"""`cranectl log layout`."""

from pathlib import Path

import click

from cranectl.cli.command import Command, OutputFile
from cranectl.cli.options import plants_option
from cranectl.support.files import JSON


@click.command("layout", cls=Command)
@click.argument("name")
@click.argument("out", type=OutputFile(JSON))
@plants_option("Whose runs the log holds. Default: all; what shows one run then shows mujoco's.")
def write_layout(name: str, out: Path, plants: tuple[str, ...]) -> None:
    """Write the layout NAME for Foxglove or Lichtblick to OUT.

    \b
    single        one run: crane, load, error, angles, inputs, tension
    comparison    several plants: the crane and its ghosts, the same signals, what parts them
    controller    what the controller thought
    ladder        all levels of `cranectl ladder` on top of each other

    \b
    cranectl log layout comparison comparison.json
    cranectl log layout single single.json --plant analytic
    """
    from cranectl.cli.output import console
    from cranectl.plants.registry import PLANTS
    from cranectl.report.viewer_layouts import layout_json
    from cranectl.support.files import write_text, writing

    content = layout_json(name, plants=plants or PLANTS)
    with writing(out):
        write_text(out, content)
    console(None).print(f"layout: {out}; in Foxglove: Layouts, Import from file")
