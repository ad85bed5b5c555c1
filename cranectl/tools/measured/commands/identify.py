"""`cranectl identify`."""

import shlex
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl import scenario as scenario_files
from cranectl.cli.command import Command
from cranectl.cli.completion import Completion
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.output import Screen
from cranectl.support import File, FileKind
from cranectl.tools import measured as measured_cranes
from cranectl.tools.measured.commands.files import MeasuredRuns

if TYPE_CHECKING:
    from cranectl.tools.measured.replay import Replay

IDENTIFIED = FileKind("file of an identified crane", rb"# (Identified from|The crane identified from) ")


@click.command("identify", cls=Command)
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=Command.PATH)
@click.option(
    "--rig",
    metavar="NAME",
    required=True,
    shell_complete=Completion.rigs,
    help="Name or TOML file of what is known of the crane.",
)
@MeasuredRuns.map_option("Map of the columns of FILEs that are no logs.")
@MeasuredRuns.sheets_option("With --map: a run for each sheet that fits, e.g. 'Run*'.")
@click.option(
    "--replay",
    type=click.Choice(["commands", "lines", "motion"]),
    help="What drives the model: commands, held from row to row; lines between them; or the motion of the "
    "axes. Default: commands, if all logs have them; of slow logs, what fits of the first two.",
)
@Command.output_option(
    "--out", IDENTIFIED, "Rig file. A campaign and the fit are written beside it. Default: identified.toml"
)
@Command.output_option("--report", FileKind.HTML, "Write one HTML page: numbers, intervals, residuals.")
@Command.json_option
def identify_command(
    files: tuple[Path, ...],
    rig: str,
    map_file: Path | None,
    sheets: str | None,
    replay: "Replay | None",
    out: Path | None,
    report: Path | None,
    screen: Screen,
) -> int:
    """Fit the numbers of a crane to at least three measured runs.

    A FILE is a log of `cranectl log import`, or with --map any file that it reads: CSV, Parquet, MCAP,
    MATLAB, HDF5, Excel or ROS bags. With --map each file is a run. `cranectl new map FILE` writes a map.
    Fitted are time constants, gains and friction of the drives, dead time, load mass, the zero of the
    rope's length and friction of the pivot. Masses of the axes, steps and noise of the encoders are those
    of the rig. Numbers of which these runs say nothing are named and keep the rig's values. Each number has
    a 95 % interval from the spread between runs and from noise and steps of the encoders.

    A misfit means that the crane does something that the model does not. It is told in millimetres. Go on
    all the same: `cranectl validate` judges runs that were not used, by your tolerance.

    Exit code 1 only if the optimiser did not finish or a prediction ended early. A misfit has exit code 0.

    \b
    cranectl identify monday.csv tuesday.csv friday.csv --map week.toml --rig lab-rig
    cranectl identify week.xlsx --map week.toml --sheets 'Run*' --rig lab-rig
    cranectl identify day-1.mcap day-2.mcap day-3.mcap --rig my-crane.toml --replay motion
    cranectl identify day-1.mcap day-2.mcap day-3.mcap --rig lab-rig --report identified.html
    """
    path = out or Path("identified.toml")
    campaign, fit = path.with_name(f"{path.stem}-campaign.toml"), measured_cranes.Fit.path(path)
    given = [*files, *([map_file] if map_file else [])]
    for file, kind in ((path, IDENTIFIED), (campaign, IDENTIFIED), (fit, FileKind.JSON)):
        kind.check_place(file, inputs=given, option="--out")
    measured = MeasuredRuns.read(files, map_file=map_file, sheets=sheets, rig=rig, screen=screen)
    named = [Path(name).name for name, _ in measured.runs]
    runs = [run for _, run in measured.runs]
    result = measured_cranes.identify(
        runs, scenario_files.RigFile.load(rig), replay=replay, progress=screen.print
    )
    names = ", ".join(named)
    base = relpath(rig, path.parent) if Path(rig).is_file() else rig
    with File(path).writing():
        File(fit).write_text(measured_cranes.Fit.text(result, runs))
        File(campaign).write_text(
            measured_cranes.campaign_text(result, path.name, f"{path.stem}-campaign", names)
        )
        File(path).write_text(measured_cranes.rig_text(result, base, names))
    screen.print(measured_cranes.IdentificationReport.table(result))
    screen.print_each(measured_cranes.IdentificationReport.remarks(result, named))
    screen.print(f"rig: {path}")
    screen.print(f"campaign: {campaign}")
    unused = f"FILE --map {shlex.quote(str(map_file))}" if map_file else "LOG"
    screen.print(f"judge runs that were not used: cranectl validate {unused} --rig {shlex.quote(str(path))}")
    if report is not None:
        page = measured_cranes.IdentificationReport.page(result, named, Command.given())
        screen.save_page(page, report)
    screen.write_json(
        {
            "rig": str(path),
            "campaign": str(campaign),
            "fit": str(fit),
            "imported": measured.imported,
            "converged": result.converged,
            "misfits": dict(result.misfits),
            "largest_m": [float(load.distance[load.largest]) for load in result.loads],
            "replay": result.replay,
            "estimates": [vars(estimate) for estimate in result.estimates],
            "unidentifiable": list(result.unidentifiable),
            "correlated": [{"of": [a, b], "correlation": c} for a, b, c in result.correlated],
        }
    )
    return ExitCode.GOOD if result.converged else ExitCode.LIMIT_EXCEEDED
