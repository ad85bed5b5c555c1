"""`cranectl run`."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl import cases, report
from cranectl import scenario as scenario_files
from cranectl.cli.command import Command
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.names import Names
from cranectl.cli.output import Screen
from cranectl.cli.refused_options import fmi_option, refuse_fmi
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.plants import DRIVES, PLANTS
from cranectl.support import File, FileKind, InputError
from cranectl.tools import export as exports

if TYPE_CHECKING:
    from cranectl.scenario import RigParameters


@click.command("run", cls=Command)
@ScenarioRequest.argument
@ControllerName.option
@Names.run_plants_option
@ScenarioRequest.drive_option(default="ideal")
@ScenarioRequest.options
@ScenarioRequest.every_option
@ControllerName.timeout_option
@Command.output_option("--out", FileKind.MCAP, "Log file. Default: logs/SCENARIO/CONTROLLER-DRIVE.mcap")
@Command.output_option(
    "--fmu", None, "Write the plant as an FMU for co-simulation: analytic or elastic.", endings=FileKind.FMUS
)
@fmi_option
@Command.json_option
def run_command(
    request: ScenarioRequest,
    controller: str | None,
    plants: tuple[str, ...],
    drive: str,
    timeout: float,
    out: Path | None,
    fmu: Path | None,
    fmi: str | None,
    screen: Screen,
) -> int:
    """Run SCENARIO, a name or a TOML file, and compare the plants.

    \b
    cranectl run fixed-position
    cranectl run settled-trajectory --controller lqr --drive velocity
    cranectl run fixed-position --plants mujoco --set rig.load_mass=2.5 --set duration=30
    cranectl run my-scenario.toml --out my.mcap --every 1
    cranectl run my-scenario.toml --rig my-crane.toml --drive velocity
    cranectl run fast-diagonal --plants analytic --drive velocity --fmu crane.fmu
    """
    case = cases.Case.of(
        request.load(),
        controller=controller,
        drive=DRIVES.checked(drive),
        plants=plants,
        log=out,
        timeout=timeout,
    )
    if fmu is None:
        refuse_fmi(fmi)
    else:
        _write_fmu(case, fmu, fmi)
    replaced = " (in place of the one that was there)" if case.log.exists() else ""
    with Screen.progress_bar(case.simulated_seconds, f"{case.scenario.name}, {case.controller}") as advance:
        result = case.run(progress=advance)
    screen.print(report.RunTables.runs({case.log.stem: result.runs}))
    notes = [case.scenario.rig.fixed_note, *case.left_out, *report.RunTables.run_notes([result])]
    screen.print_each(filter(None, notes), indent="  ")
    if beyond := [run.beyond_drives for run in result.runs if run.beyond_drives]:
        screen.print(Screen.styled(f"  {case.scenario.name} {beyond[0]}", "yellow"))
    uses = [(plant, case.drive, case.controller) for plant in case.plants]
    idle = IdleSettings.lines(case.scenario, request, uses)
    IdleSettings.print(screen, [*idle, *IdleSettings.timeout_lines([case.controller], timeout)])
    screen.print(report.RunTables.metrics({"": result.runs}))
    if (limits := report.RunTables.limits([result.runs])) is not None:
        screen.print(limits)
    if result.agreements:
        screen.print(report.RunTables.agreement(result.agreements))
        screen.print_each(report.RunTables.limit_notes(result.agreements), indent="  ")
    screen.print(f"log: {case.log}{replaced}")
    if fmu is not None:
        screen.print(f"exported: {fmu}, the {case.plants[0]} plant with {drive} drives")
    layout = _layout_for(case.plants, case.scenario.rig, case.log)
    screen.print(
        f"view: cranectl log layout {layout}; open the log in Foxglove or Lichtblick and "
        f"import the layout, or: rerun {shlex.quote(str(case.log))}"
    )
    screen.write_json(
        {
            "runs": [run.to_json() for run in result.runs],
            "agreements": [agreement.to_json() for agreement in result.agreements],
            "plants_agree": result.plants_agree,
            "limits_kept": result.limits_kept,
        }
    )
    if result.interrupted:
        return ExitCode.INTERRUPTED
    if result.stopped:
        return ExitCode.RUN_STOPPED
    return ExitCode.GOOD if result.passed else ExitCode.LIMIT_EXCEEDED


def _write_fmu(case: "cases.Case", path: Path, fmi: str | None) -> None:
    """Write the plant of a case as an FMU; raise InputError if that is not possible."""
    if len(case.plants) > 1:
        raise InputError(
            f"--fmu of {len(case.plants)} plants: {', '.join(case.plants)}",
            allowed="one plant, analytic or elastic",
            remedy="name one: --plants analytic",
        )
    content = exports.fmu_archive(
        exports.plant_model(case.scenario, case.plants[0], case.drive), int(fmi or 2)
    )
    with File(path).writing(), File(path).replacing() as part:
        part.write_bytes(content)


def _layout_for(plants: tuple[str, ...], rig: "RigParameters", log: Path) -> str:
    """Return the arguments of `cranectl log layout` for a log of `plants`."""
    name = "single" if len(plants) == 1 else "comparison"
    is_usual = scenario_files.Drawing(rig).is_as_filed and plants == PLANTS.by_default
    return f"{name} view.json" + ("" if is_usual else f" --log {shlex.quote(str(log))}")
