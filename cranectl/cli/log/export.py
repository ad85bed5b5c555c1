"""`cranectl log export`."""

from pathlib import Path

import click

from cranectl.cli.command import Command


@click.command("export", cls=Command)
@click.argument("log", metavar="LOG", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "format_name",
    metavar="NAME",
    help="csv, parquet, mat or what a package adds. Default: as FILE ends; csv without FILE.",
)
@click.option(
    "--signals",
    "patterns",
    metavar="PATTERN",
    multiple=True,
    help="Shell pattern of the columns wanted, e.g. 'mujoco.state.*'; repeatable. Default: all.",
)
@click.option(
    "--out",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Default: the log's name with the format's ending, in the working directory.",
)
def export_log(log: Path, format_name: str | None, patterns: tuple[str, ...], out: Path | None) -> None:
    """Write the signals of LOG as a table for pandas, MATLAB or Excel.

    One row a logged sample. Columns: time [s], PLANT.GROUP.SIGNAL (mujoco.state.alpha) and reference.SIGNAL
    (reference.load_x); empty, in MATLAB NaN, where a plant has no sample. All in SI units and radians;
    parquet and mat hold each signal's unit. The values are the log's to the last bit.

    \b
    cranectl log export logs/fixed-position/lqr-ideal.mcap
    cranectl log export logs/fixed-position/lqr-ideal.mcap --signals 'mujoco.state.*' --out run.mat
    """
    from cranectl.cli.output import console
    from cranectl.export import chosen_exporter, export_table, write_table
    from cranectl.log import read_log
    from cranectl.support.files import check_place

    exporter = chosen_exporter(format_name, out)
    path = out or Path(f"{log.stem}.{exporter.name}")
    check_place(path, exporter.kind, inputs=[log], option="--out")
    table = export_table(list(read_log(log).values()), patterns)
    write_table(table, path, exporter)
    size = f"{len(table.time)} samples of {len(table.columns)} signals"
    console(None).print(f"export: {path}, {size}")
