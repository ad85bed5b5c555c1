"""`cranectl render`."""

from pathlib import Path

import click

from cranectl import log as log_files
from cranectl.cli.command import Command, OutputFile
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.names import Names
from cranectl.cli.output import Screen
from cranectl.support import FileKind
from cranectl.tools import render


@click.command("render", cls=Command)
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=Command.PATH)
@click.argument("out", metavar="OUT.mp4|.gif|.png", type=OutputFile(endings=FileKind.VIDEOS))
@click.option(
    "--time",
    type=float,
    metavar="S",
    help="Moment of a .png [s]. Default: when the load is farthest from its reference.",
)
@click.option(
    "--size",
    metavar="WxH",
    help="Pixels. Default: 960x720, .gif 480x360; with --plots 1440x720, .gif 900x450.",
)
@click.option("--fps", type=float, metavar="N", help="Pictures per second. Default: 25, .gif 10.")
@click.option("--speed", type=float, metavar="X", help="Simulated seconds per second. Default: 1, real time.")
@click.option(
    "--camera",
    metavar="NAME",
    help="overview, side, top, or a camera of your own model, whose names go first. Default: overview.",
)
@click.option("--plots", is_flag=True, help="Error, angles, tension and distance of the plants beside it.")
@Names.label_option
def render_command(
    logs: tuple[Path, ...],
    out: Path,
    time: float | None,
    size: str | None,
    fps: float | None,
    speed: float | None,
    camera: str | None,
    plots: bool,
    labels: tuple[str, ...],
) -> int:
    """Draw LOG as a video, or one moment of it as a picture.

    Needs no screen. In a log of several plants, MuJoCo's crane is solid and the others are ghosts around
    it. With several LOGs, or an overlay, the first run is solid and the others are ghosts with labels.
    Beside your own model, the rope and load of the others are outlines. The rope is orange-red while it
    pulls with less than 15 % of the load's weight.

    \b
    cranectl render logs/fixed-position/lqr-ideal.mcap run.mp4 --plots
    cranectl render logs/fixed-position/lqr-ideal.mcap run.gif --speed 5
    cranectl render logs/fixed-position/lqr-ideal.mcap run.png --time 7 --camera top --size 1600x1200
    cranectl render lqr.mcap pid.mcap both.mp4 --plots
    """
    settings = render.render_settings(
        out, time=time, size=size, fps=fps, speed=speed, camera=camera, plots=plots
    )
    runs = (
        log_files.Log.gather(logs, labels=labels) if labels or len(logs) > 1 else log_files.Log.read(logs[0])
    ).runs
    with Screen.progress_bar(max(run.end_s for run in runs.values()), out.name, done="drawn") as advance:
        shown = render.draw_runs(runs, settings, progress=advance)
    what = f"picture at {shown:g} s" if settings.suffix == ".png" else f"video of {shown:g} s"
    Screen().print(f"{what}: {out}")
    return ExitCode.GOOD
