"""`cranectl info`."""

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cranectl import cases, compare, planning, plants, report, support
from cranectl import log as log_files
from cranectl.cli.command import Command
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.info_settings import kind_of, print_rig, print_scenario
from cranectl.cli.model_rig import model_settings, rig_lines
from cranectl.cli.output import Screen
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.support import InputError, Quantity

if TYPE_CHECKING:
    from cranectl.scenario import RigParameters
    from cranectl.simulate import Run


WIDTH = 26  # of the names of a model's facts [characters]
UNREAD = ("[!r]*", "rig.[!par]*", "rig.r[!o]*", "rig.rope_*")  # of a model all but its axes, rope and names


@click.command("info", cls=Command)
@click.argument("file", metavar="FILE", type=Command.PATH)
@ScenarioRequest.options
@click.option("--as-is", is_flag=True, help="Of a model: it is meant to differ, so the exit code is 0.")
@Command.json_option
def info_command(file: Path, request: ScenarioRequest, as_is: bool, screen: Screen) -> int:
    """Show what a log, a rig, a scenario or a crane's model file is.

    Of a log: scenario, design, parameters, versions, topics and verdict. Every message and checksum is
    read. A damaged file is refused with the reason.

    Of a rig, a name or TOML file: each number, and whether a file states it, or it is scaled to the size
    of the crane, or assumed as for the laboratory rig. Of a scenario, a name or TOML file: its reference,
    effects, limits and settings. --rig and --set change what is shown.

    Of a model in MJCF, a file that ends in '.xml': its drives, the numbers of a rig that it has, and how
    it differs from the rigid crane of the other plants, and what to write into a rig file. Exit code 1
    if it differs, unless --as-is is given. The rig has the names of its sites and actuators.

    \b
    cranectl info logs/fixed-position/lqr-ideal.mcap
    cranectl info my-rig.toml
    cranectl info fixed-position --rig harbour-crane
    cranectl info mine.xml --set rig.plant.names.load=hook
    """
    kind, request = kind_of(file), request._replace(source=str(file))
    if as_is and kind != "model":
        raise InputError(
            f"--as-is with {file}, which is no model",
            allowed="--as-is with a model, a file that ends in .xml",
            remedy="leave out --as-is",
        )
    if kind == "model":
        request = request._replace(source=None)
        scenario = request.read()
        IdleSettings.print(screen, IdleSettings.lines(scenario, request, (), unread=UNREAD))
        return _print_model(file, scenario.rig, as_is=as_is, screen=screen)
    if kind == "rig":
        print_rig(request, screen)
    elif kind == "scenario":
        print_scenario(request, screen)
    else:
        if request.rig or request.overrides:
            raise InputError(
                f"--rig or --set with the log {file}",
                allowed="these options with a model, a rig or a scenario",
                remedy="leave these options out",
            )
        _print_log(file, screen)
    return ExitCode.GOOD


def _print_model(file: Path, rig: "RigParameters", *, as_is: bool, screen: Screen) -> int:
    """Print what a model file is as a crane, and how it differs from others; return the exit code."""
    names = rig.model_names
    own = plants.open_model(file, names)
    differences = plants.find_differences(own)
    sizes = plants.cause_sizes(own) if differences else []
    settings = model_settings(file, rig)
    late, ratios = f" {own.delay:g} s late" * bool(own.delay), ", ".join(f"{r:g}" for r in own.ratios)
    facts = [
        ("model", file),
        *((key.replace("_", " "), name) for key, name in names if name),
        (
            "drives",
            f"take {own.servo}{late}; gears or falls: {ratios}",
        ),
        ("pose of the file", _pose(own)),
        *((d.text, f"{d.meaning}{f'; {d.line}' * bool(d.line)}") for d in differences),
        *(
            (Quantity(size, "m").difference() if size < own.rest[4] else "not separable", cause)
            for cause, size in sizes
        ),
        ("check", "differs from the rigid crane" if differences else "no difference from the rigid crane"),
        ("rig file", "as follows; in a scenario below [rig], with [rig.plant.names]"),
    ]
    screen.print_each(f"{name:{WIDTH}}{':' * (len(name) > WIDTH)} {text}" for name, text in facts)
    screen.print_each(rig_lines(file.as_posix(), rig, settings), indent="  ")
    listed = [difference._asdict() for difference in differences]
    screen.write_json(
        {
            "drives": own.servo,
            "rig": {**settings["fixed"], **settings["numbers"]},
            "ranges": settings["ranges"],
            "assumed_ranges": settings["assumed"],
            "differences": listed,
            "causes": [{"cause": c, "size_m": size if isfinite(size) else None} for c, size in sizes],
        }
    )
    return ExitCode.LIMIT_EXCEEDED if differences and not as_is else ExitCode.GOOD


def _pose(own: Any) -> str:
    """Return how the crane stands and swings in the pose of the file."""
    x, y, rope = own.rest[:6:2].tolist()
    joints = [own.model.joint(joint).name or str(joint) for joint in own.moved_joints]
    moved = f", with {' and '.join(joints)} in the middle of its range" if joints else ""
    return (
        f"{x:.4g} m along x, {y:.4g} m along y{moved}; on a rope of {rope:.4g} m the load swings with "
        f"{own.swing_period:.3g} s"
    )


def _print_log(log: Path, screen: Screen) -> None:
    """Print what a log contains."""
    read, description = log_files.Log.read(log), log_files.LogDescription.of(log)
    table = (_print_overlay if read.is_overlay else _print_plants)(description, read, screen)
    screen.print(report.RunTables.topics(description))
    screen.write_json({**description.to_json(), **table})


WIDEST = 4  # runs whose settings are told beside each other


def _print_overlay(
    description: "log_files.LogDescription", log: "log_files.Log", screen: Screen
) -> dict[str, Any]:
    """Print what the runs of an overlay are; return it as plain data."""
    runs = log.runs
    made_of: dict[str, list[str]] = {}
    for label, run in runs.items():
        for name, origin in log_files.origins(planning.add_claims(run.scenario)).items():
            made_of.setdefault(f"{name}: {origin}", []).append(label)
    software = support.Provenance.others({label: layer.versions for label, layer in log.layers.items()})
    for name, text in (
        ("file", description.path),
        ("overlay of", ", ".join(runs)),
        *(("reference", f"{', '.join(of)}: {origin}") for origin, of in made_of.items()),
        *(("differs", f"{', '.join(of)}: {difference}") for difference, of in software.items()),
        _integrity(description),
    ):
        screen.print(f"{name:12} {text}")
    screen.print(
        report.RunTables.runs({name: [cases.RunSummary.of(run, Path(name))] for name, run in runs.items()})
    )
    if len(runs) <= WIDEST:
        differing = report.LogTables.what_differs({name: {run.plant: run} for name, run in runs.items()})
        screen.print(differing or "The runs were asked for with the same settings.")
    return {"runs": [{"label": name, **_outcome(run), **_asked(run)} for name, run in runs.items()]}


def _print_plants(
    description: "log_files.LogDescription", log: "log_files.Log", screen: Screen
) -> dict[str, Any]:
    """Print what the runs of one scenario are, and how they agree; return it as plain data."""
    runs = log.runs
    run_list = list(runs.values())
    agreements = [
        compare.judge(*pair)
        for pair in compare.Agreement.pairs([run for run in run_list if len(run.time_ns)], runs)
    ]
    software = support.Provenance.differences(description.versions, support.Provenance.now())
    scenario, design = run_list[0].scenario, f"{run_list[0].controller}, {run_list[0].drive} drives"
    facts = [
        ("file", description.path),
        ("scenario", f"{scenario.name}: {scenario.title}" if scenario.title else scenario.name),
        ("design", design),
        *((r.plant, f"{r.status.label} at {r.end_s:g} s, {len(r.time_ns)} samples") for r in run_list),
        *(
            ("reference", f"{name}: {origin}")
            for name, origin in log_files.origins(planning.add_claims(scenario)).items()
        ),
        ("disturbances", scenario.disturbed_by),
        ("effects", ", ".join(scenario.effects.names) or "none"),
        ("sampling", f"{scenario.control.period:g} s, one sample of {description.every} logged"),
        *(("steps", str(plants.PhysicsStep(r.scenario, r.drive))) for r in run_list[:1] if r.has_reference),
    ]
    for agreement in agreements:
        errors = (agreement.max_load_error_m, agreement.max_angle_error_rad)
        load, angle = (Quantity(error).si_difference() for error in errors)
        why = f": {agreement.limits}" if agreement.passed is None else ""
        who = "plants" if len(agreements) == 1 else f"{agreement.plant} and {agreement.reference}"
        facts.append(("verdict", f"{who} at most {load} m, {angle} rad apart: {agreement.verdict}{why}"))
    facts += [
        ("versions", ", ".join(f"{name} {version}" for name, version in description.versions.items())),
        *(("differs", difference) for difference in software),
        ("attachments", ", ".join(description.attachments)),
        _integrity(description),
    ]
    screen.print_each(f"{name:12} {text}" for name, text in facts)
    settings = report.LogTables.settings({"": runs})
    screen.print(settings if settings.rows else "All settings have their defaults.")
    return {
        **_asked(run_list[0]),
        "runs": [_outcome(run) for run in run_list],
        "agreement": compare.Agreement.worst(agreements).to_json() if agreements else None,
        "agreements": [agreement.to_json() for agreement in agreements],
        "software_differences": software,
    }


def _integrity(description: "log_files.LogDescription") -> tuple[str, str]:
    size = f"{description.size_bytes / 1e6:.1f} MB, {description.messages} messages"
    return "integrity", f"format {description.format}, {size}; checksums and counts are right"


def _asked(run: "Run") -> dict[str, Any]:
    return {"scenario": run.scenario.model_dump(mode="json"), "design": run.design.to_json()}


def _outcome(run: "Run") -> dict[str, Any]:
    ends = {"status": run.status.label, "end_s": run.end_s, "samples": len(run.time_ns)}
    return {"plant": run.plant, "drive": run.drive, **ends}
