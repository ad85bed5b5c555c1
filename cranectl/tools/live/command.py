"""`cranectl live`."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import click

from cranectl import cases, report
from cranectl.cli.command import Command
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.counts import Count
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.names import Names
from cranectl.cli.output import Screen
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.plants import DRIVES, PLANTS
from cranectl.support import File, FileKind, Interruption, printable
from cranectl.tools import live
from cranectl.tools.live.guard import checked_origin, report_warnings

HERE = ("127.0.0.1", "localhost", "::1")


@click.command("live", cls=Command)
@ScenarioRequest.argument
@ControllerName.option
@Names.run_plants_option
@ScenarioRequest.drive_option(default="ideal")
@click.option("--speed", type=float, default=1.0, show_default=True, metavar="X", help="Times real time.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--port",
    type=Count(Count.MAX_PORT, lowest=0),
    default=8765,
    show_default=True,
    metavar="N",
    help="Port to listen on; 0: any free one.",
)
@click.option("--allow-origin", "origins", multiple=True, metavar="URL", help="A web page that may connect.")
@Command.output_option(
    "--record",
    FileKind.MCAP,
    "Log of the session, a new file. Default: logs/SCENARIO/CONTROLLER-DRIVE-live.mcap or …-2.mcap",
)
@Command.output_option(
    "--layout", FileKind.JSON, "Write a layout of this session for its viewer: its rig, what steers it."
)
@ScenarioRequest.options
def live_command(
    request: ScenarioRequest,
    controller: str | None,
    plants: tuple[str, ...],
    drive: str,
    speed: float,
    host: str,
    port: int,
    origins: tuple[str, ...],
    record: Path | None,
    layout: Path | None,
) -> int:
    """Run SCENARIO in real time, to be watched and steered.

    Foxglove shows the session until Ctrl-C. There you can pause it, change speed, controller and gains,
    apply a disturbance pulse, and reset it. Once the reference has ended you steer the load by hand.

    \b
    cranectl live settled-trajectory
    cranectl live fixed-position --controller lqr+hinf --plants mujoco --drive velocity
    cranectl live settled-trajectory --layout view.json
    cranectl live settled-trajectory --speed 0.2 --record slowly.mcap
    """
    loaded = request.load()
    design = ALL_CONTROLLERS.design(controller or loaded.controller.name, loaded)
    controls = live.Controls(loaded, design, drive=drive, speed=speed)
    plants = PLANTS.to_run(plants, loaded.rig)
    if layout:
        with File(layout).writing():
            File(layout).write_text(report.layout_json("live", plants=plants, rig=loaded.limited_rig))
    session_type = live.ChildSession if ALL_CONTROLLERS.opened.files else live.Session
    session = session_type(loaded, design, plants=plants, drive=DRIVES.checked(drive))
    address = live.Address(host, port, tuple(map(checked_origin, origins)))
    log = cases.Case.log_in(cases.Case.LOG_DIRECTORY, loaded, design.name, drive)
    requested = record or log.with_stem(f"{log.stem}-live")
    choices = [(plant, session.drive, name) for plant in plants for name in {design.name, *ALL_CONTROLLERS}]
    IdleSettings.print(
        Screen(), IdleSettings.lines(loaded, request, choices)
    )  # the user may choose any of them
    with (
        _until_ended() as stop,
        report_warnings(_warn),
        live.reserve_recording(requested, numbered=record is None) as log_file,
    ):
        server = live.LiveServer(session, controls, address, log_file)
        if host not in HERE:
            _warn(
                f"listening on {host}: anyone who reaches port {server.port} there can "
                "watch this run and steer it; nothing is encrypted, nobody is asked for a password"
            )
        machine = f"[{host}]" if ":" in host else host
        _say(f"live: {loaded.name}, {design.name}, {drive} drives, {', '.join(plants)}")
        _say(f"view: Foxglove, Open connection, ws://{machine}:{server.port}")
        _say(f"layout: {layout or 'start with --layout view.json for one of this rig'}, to be imported there")
        _say("steer: panels Parameters and Service Call; by hand: Teleop on /wish")
        _say(f"log: {log_file}; Ctrl-C ends the session and closes it")
        server.serve(stop)
    for path in server.recorded or ("nothing recorded",):
        _say(f"recorded: {path}")
    return ExitCode.GOOD


def _say(text: str) -> None:
    click.echo(printable(text))


def _warn(text: str) -> None:
    click.echo(printable(f"cranectl: warning: {text}"), err=True)


@contextlib.contextmanager
def _until_ended() -> Iterator[threading.Event]:
    """Yield an event that the first signal sets, instead of stopping in the middle of a block."""
    stop = threading.Event()

    def end() -> None:
        if stop.is_set():
            raise Interruption
        stop.set()

    before = Interruption.heed(end)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
