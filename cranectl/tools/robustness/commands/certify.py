"""`cranectl certify`."""

from pathlib import Path

import click

from cranectl import scenario as scenario_files
from cranectl.cli.command import Command
from cranectl.cli.completion import Completion
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.output import Screen
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.plants import DRIVES
from cranectl.support import FileKind
from cranectl.tools import robustness

# Of the laboratory rig, and on another one scaled by similarity.
ROPE_LENGTHS = (0.2, 0.45, 0.7, 1.0, 1.3)
TILTS = ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0))
HOISTING_SPEEDS = (-0.3, 0.0, 0.3)
DRIVEN = ("bridge", "trolley", "winch")


@click.command("certify", cls=Command)
@click.argument("controller", type=ControllerName(), shell_complete=Completion.controllers)
@click.option(
    "--scenario",
    metavar="NAME",
    shell_complete=Completion.scenarios,
    help="Whose [design], [control], [rig] and [effects] to take. Default: the defaults.",
)
@ScenarioRequest.drive_option(default="velocity", force=False)
@click.option("--time-constant", type=float, metavar="S", help="Lag of all three velocity drives [s].")
@click.option(
    "--delay", type=float, metavar="S", help="From measurement to drive [s]; effects.delay.seconds."
)
@click.option(
    "--rope-length", "rope_lengths", type=float, multiple=True, metavar="M", help="[m]; repeatable."
)
@click.option(
    "--tilt",
    "tilts",
    type=(float, float),
    multiple=True,
    metavar="A B",
    help="Constant disturbance of alpha and beta [rad/s²] that tilts the rope; repeatable.",
)
@click.option(
    "--hoisting-speed",
    "hoisting_speeds",
    type=float,
    multiple=True,
    metavar="V",
    help="Rope length rate [m/s], positive when paying out; repeatable.",
)
@click.option(
    "--open-at", metavar="NAME", help="Signal at which the loop is opened: v or v-bar. Default: as designed."
)
@click.option("--limits", is_flag=True, help="Also the largest delay and lag certified and survived.")
@ScenarioRequest.options
@Command.output_option(
    "--plot",
    None,
    "Draw the map, and distance and margin over frequency (.svg, .pdf, .png).",
    endings=FileKind.PLOTS,
)
@Command.json_option
def certify_command(
    controller: str,
    drive: str,
    time_constant: float | None,
    delay: float | None,
    rope_lengths: tuple[float, ...],
    tilts: tuple[tuple[float, float], ...],
    hoisting_speeds: tuple[float, ...],
    open_at: str | None,
    limits: bool,
    request: ScenarioRequest,
    plot: Path | None,
    screen: Screen,
) -> int:
    """Prove at which operating points CONTROLLER is stable.

    At each point the nu-gap compares the plant as it is run with the design model. The plant includes
    the linear part of the scenario's effects, rope, body and frame among them. A gap below the margin
    b(G, K) guarantees that the linear loop frozen at that point is stable. Exit code 1 if a point is
    refused; refused does not mean unstable. A controller outside the flat family is judged by its
    linearisation, if it declares one: both horizontal axes, with a load that hangs at rest.

    \b
    cranectl certify lqr-integral --delay 0.01
    cranectl certify lqr+loop-shaping --delay 0.01
    cranectl certify pole-placement --tilt 0 0 --time-constant 0.05 --delay 0.02 --limits
    cranectl certify lqr+loop-shaping --set effects.body={} --set effects.frame={}
    """
    if time_constant is not None:
        request = request.having(*(f"rig.{name}_time_constant={time_constant!r}" for name in DRIVEN))
    if delay is not None:
        request = request.having(f"effects.delay.seconds={delay!r}")
    loaded = request.load()
    checked = DRIVES.checked(drive)
    design = ALL_CONTROLLERS.design(controller, loaded)
    flat = design.axis_design is not None
    shortest = loaded.rig.rope_range[0]
    size = loaded.rig.length_scale
    length_scale, tilt_scale, speed_scale = map(scenario_files.Scaled, (1.0, -1.0, 0.5))
    scaled_lengths = {max(length_scale.sized(length, size), shortest): None for length in ROPE_LENGTHS}
    scaled_tilts = [(tilt_scale.sized(alpha, size), tilt_scale.sized(beta, size)) for alpha, beta in TILTS]
    scaled_speeds = [speed_scale.sized(speed, size) for speed in HOISTING_SPEEDS]
    points = robustness.OperatingPoint.grid(
        loaded,
        rope_lengths=rope_lengths or list(scaled_lengths),
        tilts=tilts or (scaled_tilts if flat else scaled_tilts[:1]),
        hoisting_speeds=hoisting_speeds or (scaled_speeds if flat else (0.0,)),
    )
    nominal_loops = robustness.make_nominal_loops(loaded, design, points, open_at)
    with Screen.progress_bar(len(points), design.name, done="points") as advance:
        certificate = robustness.certify(nominal_loops, loaded, points, drive=checked, progress=advance)
    nominal_loop = nominal_loops[certificate.worst.point.rope_length]
    inner = nominal_loop.inner_loop(loaded, certificate.worst.point, checked)
    margins = robustness.drive_margins(inner, nominal_loop.opening.axis.robustifier, nominal_loop.period)
    lengths = sorted({point.rope_length for point in points})
    end_lengths = dict.fromkeys((lengths[0], lengths[-1])) if limits else ()
    ends = [robustness.OperatingPoint(length) for length in end_lengths]
    limit_list = [
        robustness.find_limits(nominal_loops[end.rope_length], loaded, end, checked) for end in ends
    ]
    screen.print(robustness.CertificateTables.map(certificate))
    screen.print_each(robustness.CertificateTables.summary_lines(certificate))
    screen.print(robustness.CertificateTables.drives(margins, certificate.worst))
    if limit_list:
        screen.print(robustness.CertificateTables.limits(limit_list))
    taken = robustness.present(loaded.effects, robustness.LINEAR)
    left = robustness.present(loaded.effects, robustness.NOT_LINEAR)
    for what, names in (("of the effects, in the linear loop", taken), ("not linear, left out", left)):
        if names:
            screen.print(f"{what}: {', '.join(names)}")
    unread = (*IdleSettings.OF_RUNS, *IdleSettings.OF_MOTIONS)
    IdleSettings.print_in_analysis(screen, loaded, request, [controller], drive=checked, unread=unread)
    if plot is not None:
        screen.save_figure(robustness.certificate_figure(certificate, (nominal_loop, inner)), plot)
    data = certificate.to_json() | {
        "drive_margins_at_worst": margins.to_json(),
        "taken_in": taken,
        "left_out": left,
    }
    if limit_list:
        data["limits"] = [found_limits.to_json() for found_limits in limit_list]
    screen.write_json(data)
    return ExitCode.GOOD if certificate.certified else ExitCode.LIMIT_EXCEEDED
