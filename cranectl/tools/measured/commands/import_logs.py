"""`cranectl log import`."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import click

from cranectl import cases
from cranectl import log as log_files
from cranectl.cli.command import Command
from cranectl.cli.output import Screen
from cranectl.support import FileKind, InputError
from cranectl.tools import measured as measured_cranes
from cranectl.tools.measured.commands.files import MeasuredRuns


@click.command("import", cls=Command)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=Command.PATH)
@MeasuredRuns.map_option("Map of the columns.", required=True)
@click.option("--rig", metavar="NAME", help="Name or TOML file of a rig. Default: that of the map.")
@click.option(
    "--each",
    "separate",
    is_flag=True,
    help="Write a log for each FILE: logs/NAME/FILE.mcap, NAME of the map.",
)
@MeasuredRuns.sheets_option(
    "With --each: a log for each sheet that fits, e.g. 'Run*'; its columns are named without the sheet."
)
@Command.output_option("--out", FileKind.MCAP, "Log file. Default: logs/NAME/measured.mcap")
@Command.json_option
def import_log(
    files: tuple[Path, ...],
    map_file: Path,
    rig: str | None,
    separate: bool,
    sheets: str | None,
    out: Path | None,
    screen: Screen,
) -> None:
    """Make a log from files that a real crane's measuring system wrote.

    The map says which column holds which signal, with unit, sign, zero, scale, delay and clock.
    `cranectl new map FILE` writes one to fill in. Files may be CSV, Parquet, MCAP, MATLAB, HDF5, Excel
    or ROS bags. What cannot be right is refused: clocks that do not increase, gaps, jumps beyond the
    drives, angles that do not answer the motion of the crane, and axes that do not answer their
    commands. With --each physics judges the map by all files together, and then each file. The log has
    the plant `measured`, and all commands that read logs take it.

    \b
    cranectl new map monday.csv
    cranectl log import monday.csv --map monday-map.toml
    cranectl log import drives.csv camera.csv --map both.toml --out logs/monday/measured.mcap
    cranectl log import monday.csv tuesday.csv --map week.toml --each
    cranectl compare logs/monday/measured.mcap
    """
    mapping = measured_cranes.MeasuredMap.read(map_file)
    logs = _logs(files, mapping, separate=separate, sheets=sheets, out=out)
    for path in logs:
        FileKind.MCAP.check_place(path, inputs=[*files, map_file], option="--out")
    results = measured_cranes.import_runs([*logs.values()], mapping, directory=map_file.parent, rig=rig)
    for path, imported in zip(logs, results, strict=True):
        log_files.write_log(path, [imported.run])
        MeasuredRuns.print_imported("measured", imported, screen)
        screen.print(f"log: {path}")
    if not separate:
        screen.print(f"compare it with models: cranectl compare {shlex.quote(str(next(iter(logs))))}")
    facts = [
        {"log": str(path), **MeasuredRuns.facts(imported)}
        for path, imported in zip(logs, results, strict=True)
    ]
    screen.write_json({"logs": facts} if separate else facts[0])


def _logs(
    files: Sequence[Path],
    mapping: "measured_cranes.MeasuredMap",
    *,
    separate: bool,
    sheets: str | None,
    out: Path | None,
) -> Mapping[Path, "measured_cranes.LogSource"]:
    """Return the logs to write, and what each is from."""
    if not separate:
        if sheets is not None:
            raise InputError(
                "--sheets without --each",
                allowed="--sheets for a log of each sheet",
                remedy="add --each, or leave --sheets out and name columns as SHEET.COLUMN",
            )
        source = measured_cranes.LogSource(mapping.name, tuple(files))
        return {out or cases.Case.LOG_DIRECTORY / mapping.name / "measured.mcap": source}
    if out is not None:
        raise InputError(
            f"--out {out} for several logs",
            allowed="the places logs/NAME/FILE.mcap, with the name in the map",
            remedy="leave --out out, and write another name into the map for another directory",
        )
    logs: dict[Path, measured_cranes.LogSource] = {}
    for source in measured_cranes.each_source(files, mapping, sheets):
        path = cases.Case.LOG_DIRECTORY / mapping.name / f"{source.name}.mcap"
        if path in logs:
            raise InputError(
                f"{source.label} and {logs[path].label} would both become {path}",
                allowed="files with names of their own",
                remedy="rename one of them",
            )
        logs[path] = source
    return logs
