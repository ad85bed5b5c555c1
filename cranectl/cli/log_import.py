"""`cranectl log import`."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cranectl.cli import command
from cranectl.cli.output import Screen
from cranectl.support.errors import InputError
from cranectl.support.files import MCAP, check_place

if TYPE_CHECKING:
    from cranectl.measured.importing import Imported, LogSource
    from cranectl.measured.mapping import MeasuredMap


@click.command("import", cls=command.Command)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=command.PATH)
@click.option(
    "--map", "map_file", metavar="FILE", type=command.PATH, required=True, help="Map of the columns."
)
@click.option("--rig", metavar="NAME", help="Name or TOML file of a rig. Default: that of the map.")
@click.option(
    "--each",
    "separate",
    is_flag=True,
    help="Write a log for each FILE: logs/NAME/FILE.mcap, NAME of the map.",
)
@click.option(
    "--sheets",
    metavar="PATTERN",
    help="With --each: a log for each sheet that fits, e.g. 'Run*'; its columns are named without the sheet.",
)
@command.output_option("--out", MCAP, "Log file. Default: logs/NAME/measured.mcap")
@command.json_option
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
    from cranectl.log.writer import write_log
    from cranectl.measured.importing import import_logs
    from cranectl.measured.mapping import read_map

    mapping = read_map(map_file)
    logs = _logs(files, mapping, separate=separate, sheets=sheets, out=out)
    for path in logs:
        check_place(path, MCAP, inputs=[*files, map_file], option="--out")
    sources = {path.stem if separate else mapping.name: source for path, source in logs.items()}
    results = import_logs(sources, mapping, directory=map_file.parent, rig=rig)
    for path, imported in zip(logs, results, strict=True):
        write_log(path, [imported.run])
        _print(path, imported, screen)
    if not separate:
        screen.print(f"compare it with models: cranectl compare {shlex.quote(str(next(iter(logs))))}")
    tables = [_to_json(path, imported) for path, imported in zip(logs, results, strict=True)]
    screen.write_json({"logs": tables} if separate else tables[0])


def _logs(
    files: Sequence[Path], mapping: "MeasuredMap", *, separate: bool, sheets: str | None, out: Path | None
) -> Mapping[Path, "LogSource"]:
    """Return the logs to write, and what each is from."""
    from cranectl.cases.case import LOG_DIRECTORY
    from cranectl.measured.importing import LogSource, sources_of
    from cranectl.measured.suggestion import run_name

    if not separate:
        if sheets is not None:
            raise InputError(
                "--sheets without --each",
                allowed="--sheets for a log of each sheet",
                remedy="add --each, or leave --sheets out and name columns as SHEET.COLUMN",
            )
        return {out or LOG_DIRECTORY / mapping.name / "measured.mcap": LogSource(tuple(files))}
    if out is not None:
        raise InputError(
            f"--out {out} for several logs",
            allowed="the places logs/NAME/FILE.mcap, with the name in the map",
            remedy="leave --out out, and write another name into the map for another directory",
        )
    logs: dict[Path, LogSource] = {}
    for source in (source for file in files for source in sources_of(file, sheets, mapping.layout)):
        stem = source.files[0].stem + f"-{source.sheet}" * bool(source.sheet)
        path = LOG_DIRECTORY / mapping.name / f"{run_name(stem)}.mcap"
        if path in logs:
            raise InputError(
                f"{source.label} and {logs[path].label} would both become {path}",
                allowed="files with names of their own",
                remedy="rename one of them",
            )
        logs[path] = source
    return logs


def _print(path: Path, imported: "Imported", screen: Screen) -> None:
    """Print what was imported, and what physics says of it."""
    run = imported.run
    columns = ", ".join(group.name for group in run.groups)
    screen.print(
        f"measured: {len(run.time_ns)} samples every {run.scenario.control.period:g} s for {run.end_s:g} s: "
        f"{columns}"
    )
    screen.print_each(finding.text for finding in imported.findings)
    screen.print_each(f"the map contradicts physics: {text}" for text in imported.contradictions)
    screen.print_each(imported.remarks)
    screen.print(f"log: {path}")


def _to_json(path: Path, imported: "Imported") -> dict[str, Any]:
    """Return what was imported as plain data."""
    run = imported.run
    return {
        "log": str(path),
        "samples": len(run.time_ns),
        "end_s": run.end_s,
        "groups": [group.name for group in run.groups],
        "findings": [finding.to_json() for finding in imported.findings],
        "contradictions": imported.contradictions,
        "remarks": imported.remarks,
    }
