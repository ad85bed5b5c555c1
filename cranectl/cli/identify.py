"""`cranectl identify`."""

import shlex
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli import command, exit_codes
from cranectl.cli.measured import measured_run
from cranectl.cli.output import Screen
from cranectl.support.files import HTML, JSON, Kind, check_place, write_text, writing

if TYPE_CHECKING:
    from cranectl.measured.replay import Replay

IDENTIFIED = Kind("file of an identified crane", rb"# (Identified from|The crane identified from) ")


@click.command("identify", cls=command.Command)
@click.argument("logs", metavar="LOG LOG LOG...", nargs=-1, required=True, type=command.PATH)
@click.option("--rig", metavar="NAME", required=True, help="Name or TOML file of what is known of the crane.")
@click.option(
    "--replay",
    type=click.Choice(["commands", "motion"]),
    help="What drives the model. Default: the commands, if all logs have them.",
)
@command.output_option(
    "--out", IDENTIFIED, "Rig file. A campaign and the fit are written beside it. Default: identified.toml"
)
@command.output_option("--report", HTML, "Write one HTML page: numbers, intervals, residuals.")
@command.json_option
def identify_command(
    logs: tuple[Path, ...],
    rig: str,
    replay: "Replay | None",
    out: Path | None,
    report: Path | None,
    screen: Screen,
) -> int:
    """Fit the numbers of a crane to measured LOGs.

    The logs are those of `cranectl log import`, of one crane. Fitted are time constants, gains and
    friction of the drives, dead time, load mass, the zero of the rope's length and friction of the pivot.
    Masses of the axes, steps and noise of the encoders are those of the rig. Numbers of which these logs
    say nothing are named and keep the rig's values. Each number has a 95 % interval from the spread
    between logs and from a comparison with MuJoCo.

    Exit code 1 if the model misses the readings by more than their noise. Then the numbers mean little.

    \b
    cranectl identify monday.mcap tuesday.mcap friday.mcap --rig lab-rig
    cranectl identify day-1.mcap day-2.mcap day-3.mcap --rig my-crane.toml --replay motion
    cranectl identify day-1.mcap day-2.mcap day-3.mcap --rig lab-rig --report identified.html
    """
    from cranectl.measured.identification import identify
    from cranectl.measured.identified import campaign_text, rig_text
    from cranectl.measured.verdict import fit_path, fit_text
    from cranectl.report.measured import identification_page, identified_table, remarks
    from cranectl.scenario.load import load_rig

    path = out or Path("identified.toml")
    campaign, fit = path.with_name(f"{path.stem}-campaign.toml"), fit_path(path)
    for file, kind in ((path, IDENTIFIED), (campaign, IDENTIFIED), (fit, JSON)):
        check_place(file, kind, inputs=logs, option="--out")
    runs = [measured_run(log) for log in logs]
    result = identify(runs, load_rig(rig), replay=replay, progress=screen.print)
    names = ", ".join(log.name for log in logs)
    base = relpath(rig, path.parent) if Path(rig).is_file() else rig
    with writing(path):
        write_text(fit, fit_text(result, runs))
        write_text(campaign, campaign_text(result, path.name, f"{path.stem}-campaign", names))
        write_text(path, rig_text(result, base, names))
    screen.print(identified_table(result))
    screen.print_each(remarks(result))
    screen.print(f"rig: {path}")
    screen.print(f"campaign: {campaign}")
    screen.print(f"judge runs that were not used: cranectl validate LOG --rig {shlex.quote(str(path))}")
    if report is not None:
        page = identification_page(result, [log.name for log in logs], command.command_given())
        screen.save_page(page, report)
    screen.write_json(
        {
            "rig": str(path),
            "campaign": str(campaign),
            "fit": str(fit),
            "converged": result.converged,
            "misfit": result.misfit,
            "replay": result.replay,
            "estimates": [vars(estimate) for estimate in result.estimates],
            "unidentifiable": list(result.unidentifiable),
            "correlated": [{"of": [a, b], "correlation": c} for a, b, c in result.correlated],
        }
    )
    return exit_codes.GOOD if result.converged else exit_codes.LIMIT_EXCEEDED
