"""`cranectl log`: import, export, recover or overlay logs, lay out a viewer."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl import cases, compare, report
from cranectl import log as log_files
from cranectl.cli.command import Command, CommandGroup, OutputFile
from cranectl.cli.names import Names
from cranectl.cli.output import Screen
from cranectl.plants import PLANTS
from cranectl.signals import SignalGroup
from cranectl.support import File, FileKind, InputError
from cranectl.tools import robustness
from cranectl.tools.measured.commands.import_logs import import_log

if TYPE_CHECKING:
    from cranectl.simulate import Run


@click.command("export", cls=Command)
@click.argument("log", metavar="LOG", type=Command.PATH)
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
    "--out", metavar="FILE", type=Command.PATH, help="Default: beside LOG, with the format's ending."
)
def export_log(log: Path, format_name: str | None, patterns: tuple[str, ...], out: Path | None) -> None:
    """Write the signals of LOG as a table for pandas, MATLAB or Excel.

    There is one row for each logged sample. Columns are time [s], PLANT.GROUP.SIGNAL
    (mujoco.state.alpha) and reference.SIGNAL (reference.load_x); in an overlay LABEL.GROUP.SIGNAL and
    LABEL.reference.SIGNAL. A cell is empty, in MATLAB NaN, where a run has no sample. Units are SI and
    radians; parquet and mat contain the unit of each signal. Values equal the log's to the last bit.

    \b
    cranectl log export logs/fixed-position/lqr-ideal.mcap
    cranectl log export logs/fixed-position/lqr-ideal.mcap --signals 'mujoco.state.*' --out run.mat
    """
    exporter = log_files.Exporter.choose(format_name, out)
    path = out or log.parent / f"{log.stem}.{exporter.name}"
    runs = log_files.Log.read(log)
    exporter.kind.check_place(path, inputs=[log], option="--out")
    table = runs.table(patterns)
    exporter.save(table, path)
    size = f"{len(table.time)} samples of {len(table.columns)} signals"
    screen = Screen()
    screen.print(f"export: {path}, {size}")
    screen.print_each(f"renamed: {name} is {new}" for name, new in exporter.renamed(table).items())


@click.command("layout", cls=Command)
@click.argument("name")
@click.argument("out", type=OutputFile(FileKind.JSON))
@Names.plants_option(
    "Whose runs the log holds. Default: the usual; what shows one run then shows mujoco's.", of_logs=True
)
@click.option(
    "--log",
    metavar="LOG",
    type=Command.PATH,
    help="What is to be shown: its plants or labels, what its controller logs, and a camera that sees all of "
    "its rig. Default: a log of the flat family on the laboratory's rig.",
)
def write_layout(name: str, out: Path, plants: tuple[str, ...], log: Path | None) -> None:
    """Write the layout NAME for Foxglove or Lichtblick to OUT.

    \b
    single        one run: crane, load, error, angles, inputs, tension
    comparison    several plants: the crane and its ghosts, the same signals, what separates them
    controller    what the controller computes and records
    live          a live session, and what steers it
    overlay       the runs of `cranectl log overlay` on top of each other
    ladder        all levels of `cranectl ladder` on top of each other

    \b
    cranectl log layout comparison comparison.json
    cranectl log layout single single.json --plant analytic
    cranectl log layout comparison view.json --log logs/harbour/lqr-ideal.mcap
    cranectl log layout overlay view.json --log logs/fixed-position/overlay.mcap
    """
    shown = log_files.Log.read(log) if log else log_files.Log({})
    runs = shown.runs
    rigs = [run.scenario.limited_rig for run in runs.values()]
    labels = tuple(runs) if shown.is_overlay else ()
    if name == "ladder" and not labels:
        labels = robustness.NAMES
    plants = PLANTS.of_logs(plants, () if labels else runs)
    if runs and not labels:
        plants = plants or tuple(runs)
    design = shown.first.run.design if runs else None
    content = report.layout_json(
        name,
        plants=plants,
        labels=labels,
        rig=rigs[0] if rigs else None,
        logged=design.signals if design and design.axis_design is None else None,
        recorded=_signals_without_reference(runs),
    )
    with File(out).writing():
        File(out).write_text(content)
    Screen().print(f"layout: {out}; in Foxglove: Layouts, Import from file")


def _signals_without_reference(runs: Mapping[str, "Run"]) -> set[str] | None:
    """Return topic and field of all signals of runs without a reference; None if all runs have one."""
    if all(run.has_reference for run in runs.values()):
        return None
    between = dict.fromkeys(
        (log_files.Topics.DISTANCE.name, log_files.Topics.STEP), log_files.Topics.DISTANCE
    )
    between["reference"] = SignalGroup.REFERENCE
    groups = {
        log_files.Topics(label).of(name): group
        for label, run in runs.items()
        for name, group in [*between.items(), *((group.name, group) for group in run.groups)]
    }
    return {f"{topic}.{name}" for topic, group in groups.items() for name in group.names}


@click.command("overlay", cls=Command)
@click.argument("logs", metavar="LOG LOG...", nargs=-1, required=True, type=Command.PATH)
@Command.output_option("--out", FileKind.MCAP, "Log of all. Default: logs/SCENARIO/overlay.mcap")
@Names.label_option
@Names.plants_option("Whose runs to take of each LOG. Default: MuJoCo's.", of_logs=True)
@Command.json_option
def overlay_logs(
    logs: tuple[Path, ...], out: Path | None, labels: tuple[str, ...], plants: tuple[str, ...], screen: Screen
) -> None:
    """Put the runs of several LOGs into one log.

    Runs may differ in controller, drives, rig or settings. The first one is the solid crane, the others
    are ghosts. Topics begin with the label of their run, such as /lqr/load. `info`, `compare`,
    `report`, `render` and `log export` read such a log too.

    \b
    cranectl log overlay logs/fixed-position/lqr-ideal.mcap logs/fixed-position/pole-placement-ideal.mcap
    cranectl log overlay stiff.mcap soft.mcap --label stiff,soft --out both.mcap
    """
    gathered = log_files.Log.gather(logs, labels=labels, plants=plants)
    runs = gathered.runs
    if len(runs) < 2:
        raise InputError(
            f"{logs[0]} alone, of which one run is taken",
            allowed="two runs or more",
            remedy="name another log, or the plants of this one with --plants all",
        )
    path = out or cases.Case.LOG_DIRECTORY / next(iter(runs.values())).scenario.name / "overlay.mcap"
    FileKind.MCAP.check_place(path, inputs=logs, option="--out")
    comparisons = compare.Comparison.against_first(runs)
    gathered.write_overlay(path)
    scenarios = dict.fromkeys(run.scenario.name for run in runs.values())
    if len(scenarios) > 1:
        screen.print(Screen.styled(f"scenarios differ: {', '.join(scenarios)}", "yellow"))
    screen.print(report.DifferenceTables.distances(next(iter(runs)), comparisons))
    screen.print(f"log: {path}")
    screen.print(f"view: cranectl log layout overlay view.json --log {shlex.quote(str(path))}")
    compared = [comparison.to_json() for comparison in comparisons.values()]
    screen.write_json({"log": str(path), "labels": [*runs], "comparisons": compared})


@click.command("recover", cls=Command)
@click.argument("file", metavar="FILE", type=Command.PATH)
@Command.output_option(
    "--out", FileKind.MCAP, "Log file. Default: the place the log should have had, if it is free"
)
@Command.json_option
def recover_log_command(file: Path, out: Path | None, screen: Screen) -> None:
    """Save the readable part of FILE, a log that was cut off.

    A log is cut off when its process is killed or the disk is full. At most the last chunk of 64 KiB is
    missing. FILE itself is not changed.

    \b
    cranectl log recover logs/fixed-position/lqr-ideal.mcap.4711.part
    """
    recovery = log_files.recover_log(file, out)
    screen.print(f"{recovery.messages} messages of {file} are whole")
    for run in recovery.runs:
        expected = f" of {run.expected}" if run.expected is not None else ""
        screen.print(f"  {run.plant}: {run.status} at {run.end_s:g} s, {run.samples}{expected} samples")
    if recovery.lost:
        screen.print(f"  the last {recovery.lost} of {recovery.size} bytes are no whole chunk, and lost")
    if count := len(recovery.left_out):
        topics = "1 topic is" if count == 1 else f"{count} topics are"
        screen.print(f"  {topics} left out, of other tools or versions: {', '.join(recovery.left_out)}")
    screen.print(f"log: {recovery.log}")
    screen.write_json(recovery.to_json())


log_command = CommandGroup(
    "log",
    [import_log, export_log, write_layout, overlay_logs, recover_log_command],
    help="Import, export, recover or overlay logs, lay out a viewer.",
)
