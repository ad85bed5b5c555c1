"""Runs of a measured crane: in measured files with a map, and in logs of `cranectl log import`."""

import re
import shlex
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from cranectl import log as log_files
from cranectl.cli.command import Command
from cranectl.cli.output import Screen
from cranectl.support import FileKind, InputError, LogError
from cranectl.tools import measured as measured_cranes

if TYPE_CHECKING:
    from cranectl.simulate import Run
    from cranectl.tools.measured.importing import Imported

F = TypeVar("F", bound=Callable[..., Any])


class MeasuredRuns(NamedTuple):
    """Runs in the order in which their files were named, and facts on those that were imported."""

    runs: list[tuple[str, "Run"]]  # with the name of each: its file, and its sheet
    imported: list[dict[str, Any]]  # as plain data

    @staticmethod
    def map_option(help_text: str, *, required: bool = False) -> Callable[[F], F]:
        """Return the option `--map`, the map of the columns of measured files."""
        return click.option(
            "--map", "map_file", metavar="FILE", type=Command.PATH, required=required, help=help_text
        )

    @staticmethod
    def sheets_option(help_text: str) -> Callable[[F], F]:
        """Return the option `--sheets`, which makes a run of each sheet of a workbook."""
        return click.option("--sheets", metavar="PATTERN", help=help_text)

    @staticmethod
    def read(
        files: Sequence[Path], *, map_file: Path | None, sheets: str | None, rig: str, screen: Screen
    ) -> "MeasuredRuns":
        """Return the measured runs in `files`, which may be logs, and with a map any files that it describes.

        Files that are no logs are imported in memory, as `log import --each` does: physics judges all of them
        together, and then each. Prints what was imported, and how to look at it. `rig` is the name or file of
        the crane. Raises InputError as `import_runs` does, for a map without files and for files without a
        map.
        """
        logs = {path: _run_of_log(path, has_map=map_file is not None) for path in dict.fromkeys(files)}
        raw = [path for path, run in logs.items() if run is None]
        if map_file is None:
            if sheets is not None:
                raise InputError(
                    "--sheets without --map",
                    allowed="--sheets for workbooks, with a map of the columns of their sheets",
                    remedy="add --map FILE, or leave --sheets out",
                )
            return MeasuredRuns([(str(path), run) for path in files if (run := logs[path])], [])
        if not raw:
            raise InputError(
                f"--map {map_file} for logs of `cranectl log import`, which were imported already",
                allowed="--map for measured files",
                remedy="leave --map out",
            )
        mapping = measured_cranes.MeasuredMap.read(map_file)
        sources = measured_cranes.each_source(raw, mapping, sheets)
        results = measured_cranes.import_runs(sources, mapping, directory=map_file.parent, rig=rig)
        named: dict[Path, list[tuple[str, Run]]] = {}
        for source, imported in zip(sources, results, strict=True):
            named.setdefault(source.files[0], []).append((source.label, imported.run))
            MeasuredRuns.print_imported(source.label, imported, screen)
        options = f"--map {shlex.quote(str(map_file))} --rig {shlex.quote(rig)} --each"
        options += f" --sheets {shlex.quote(sheets)}" if sheets else ""
        screen.print(f"look at them: cranectl log import {shlex.join(map(str, raw))} {options}")
        named |= {path: [(str(path), run)] for path, run in logs.items() if run is not None}
        runs = [named_run for path in files for named_run in named[path]]
        facts = [
            {"name": source.label, **MeasuredRuns.facts(imported)}
            for source, imported in zip(sources, results, strict=True)
        ]
        return MeasuredRuns(runs, facts)

    @staticmethod
    def print_imported(name: str, imported: "Imported", screen: Screen) -> None:
        """Print what was imported, and what physics says of it."""
        run = imported.run
        columns = ", ".join(group.name for group in run.groups)
        screen.print(
            f"{name}: {len(run.time_ns)} samples every {run.scenario.control.period:g} s for {run.end_s:g} "
            "s: "
            f"{columns}"
        )
        screen.print_each(finding.text for finding in imported.findings)
        screen.print_each(f"the map contradicts physics: {text}" for text in imported.contradictions)
        screen.print_each(imported.remarks)

    @staticmethod
    def facts(imported: "Imported") -> dict[str, Any]:
        """Return what was imported as plain data."""
        run = imported.run
        return {
            "samples": len(run.time_ns),
            "end_s": run.end_s,
            "groups": [group.name for group in run.groups],
            "findings": [finding.to_json() for finding in imported.findings],
            "contradictions": imported.contradictions,
            "remarks": imported.remarks,
        }


def _run_of_log(path: Path, *, has_map: bool) -> "Run | None":
    """Return the measured run of a log, or None for a file that needs a map; raise InputError if neither."""
    if path.is_file() and not _is_mcap(path):
        if has_map:
            return None
        raise InputError(
            f"{path} is no log of `cranectl log import`, and has no map of its columns",
            allowed="such logs, or measured files with --map",
            remedy=f"add --map FILE; this command begins one: cranectl new map {shlex.quote(str(path))}",
        )
    try:
        run = log_files.read_log(path).get("measured")
    except LogError:
        if has_map:  # the import says what is wrong with a file that is no log of any program
            return None
        raise
    if run is None and has_map:
        return None
    if run is None or not run.has("state"):
        raise InputError(
            f"{path} has no measured run with angles",
            allowed="logs of `cranectl log import` with positions and angles",
            remedy="import the measured files, with the columns of both angles in the map",
        )
    return run


def _is_mcap(path: Path) -> bool:
    with suppress(OSError), path.open("rb") as file:
        return bool(re.match(FileKind.MCAP.begins, file.read(16)))
    return True  # for the reader of logs, which says why it cannot be read
