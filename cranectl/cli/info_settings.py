"""What `cranectl info` says of rigs and scenarios, and of files that it does not show."""

import shlex
from pathlib import Path
from typing import Literal

from cranectl import scenario as scenario_files
from cranectl.cli.output import Screen
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.plants import PLANTS
from cranectl.report import Cell, Table
from cranectl.support import TOML, File, InputError, Tree

Kind = Literal["model", "rig", "scenario", "log"]
CONTROLLERS = (".py", ".so", ".fmu")
MAGIC = b"\x89MCAP0\r\n"  # every MCAP file begins with it
SHOWN = "logs (.mcap), models (.xml), rigs and scenarios (.toml, or a name in `cranectl list`)"


def kind_of(file: Path) -> Kind:
    """Return what `info` shows of a file or name; raise InputError for what it does not show."""
    if not File(file).exists() and str(file) in scenario_files.RigFile.names():
        return "rig"
    if not File(file).exists() and str(file) in scenario_files.scenario_names():
        return "scenario"
    if file.suffix == PLANTS.MODEL_ENDING:
        return "model"
    if file.suffix == ".toml":
        return _kind_of_table(file)
    if Path(str(file).partition(":")[0]).suffix in CONTROLLERS:
        name = ":NAME" if file.suffix == ".py" else ""  # a file in Python may have several
        remedy = f"cranectl run fast-diagonal --controller {shlex.quote(str(file))}{name}"
        raise InputError(f"{file} is a controller", allowed=SHOWN, remedy=remedy)
    if File(file).exists() and file.is_file() and not _is_log(file):
        remedy = (
            f"name one of these; a measured file gets a map by: cranectl new map {shlex.quote(str(file))}"
        )
        raise InputError(f"{file} is another kind of file", allowed=SHOWN, remedy=remedy)
    return "log"


def _kind_of_table(file: Path) -> Kind:
    """Return what a TOML file is, by its keys."""
    keys, path = set(TOML.read(file)), shlex.quote(str(file))
    others = {  # by a key that no other kind of file has
        "scenario": ("a campaign", f"cranectl campaign show {path}"),
        "scenarios": ("a benchmark", f"cranectl benchmark run {path}"),
        "signals": ("a map of measured columns", f"cranectl log import MEASURED --map {path}"),
        "program": ("a controller", f"cranectl run fast-diagonal --controller {path}"),
        "address": ("a controller", f"cranectl run fast-diagonal --controller {path}"),
    }
    for key, (what, remedy) in others.items():
        if key in keys:
            raise InputError(f"{file} is {what}", allowed=SHOWN, remedy=remedy)
    if keys & {"reference", "duration"}:
        return "scenario"
    if not keys or keys & {*scenario_files.RigParameters.model_fields, "extends"}:
        return "rig"
    raise InputError(
        f"{file} has the keys {', '.join(sorted(keys)[:5])}, of neither a rig nor a scenario",
        allowed=SHOWN,
        remedy="see the keys of a rig by: cranectl list --schema rig",
    )


def _is_log(file: Path) -> bool:
    """Return True if a file is an MCAP file, by its ending or its first bytes."""
    try:
        with file.open("rb") as opened:
            return file.suffix == ".mcap" or opened.read(len(MAGIC)) == MAGIC
    except OSError:  # the reader of logs says why
        return True


def print_rig(request: ScenarioRequest, screen: Screen) -> None:
    """Print each number of a rig and where it comes from."""
    if request.rig is not None:
        raise InputError(
            f"--rig {request.rig} of the rig {request.source}",
            allowed="one rig, changed by --set",
            remedy="leave out --rig",
        )
    rig = scenario_files.RigOrigins.read(str(request.source), request.overrides)
    screen.print(_rig_table(f"Rig {request.source}", rig))
    screen.print(f"{rig.stated} stated, {rig.scaled} scaled, {rig.assumed} assumed")
    if rig.scaled:
        screen.print(
            f"scaled from the laboratory rig: lengths by {rig.length:.3g}, times by {rig.length**0.5:.3g}, "
            f"masses and forces by {rig.mass:.3g}"
        )
    screen.print_each(filter(None, [rig.rig.fixed_note, rig.rig.mass_warning]))
    screen.write_json(
        {
            "kind": "rig",
            "rig": rig.rig.model_dump(mode="json"),
            "origins": {number.name: number.origin for number in rig.numbers},
            "length_scale": rig.length,
            "mass_scale": rig.mass,
        }
    )


def _rig_table(title: str, rig: "scenario_files.RigOrigins") -> Table:
    rows = (
        Cell.row(n.name, Tree(n.value).text(), Cell(n.origin, "" if n.is_stated else "open"), n.meaning)
        for n in rig.numbers
    )
    note = "Numbers of effects act in runs that have the effect. Units are SI; every key: list --schema rig."
    return Table(title, ("number", "value", "from", "meaning"), tuple(rows), labels=4, note=note)


def print_scenario(request: ScenarioRequest, screen: Screen) -> None:
    """Print what a scenario asks for, without planning its motions."""
    scenario = request.read()
    segments = [segment.kind for segment in scenario.reference.segments]
    start = ", ".join(f"{number:g}" for number in scenario.reference.start)
    limits = scenario.limits.model_dump(mode="json", exclude_none=True)
    facts = [
        ("scenario", f"{scenario.name}: {scenario.title}" if scenario.title else scenario.name),
        ("duration", f"{scenario.duration:g} s, {scenario.steps} samples of {scenario.control.period:g} s"),
        ("controller", scenario.controller.name),
        ("reference", f"from ({start}) m: {', '.join(segments) or 'the load is held'}"),
        ("disturbances", scenario.disturbed_by),
        ("effects", ", ".join(scenario.effects.names) or "none"),
        ("limits", ", ".join(f"{name} = {Tree(limit).text()}" for name, limit in limits.items()) or "none"),
        ("must end", scenario.expected),
    ]
    screen.print_each(f"{name:12} {text}" for name, text in facts)
    assumed = scenario.assumed_settings
    rows = tuple(
        Cell.row(name, Tree(value).text(), "scaled to the crane" if name in assumed else "")
        for name, value in scenario.changed_from_default.items()
    )
    title = "Settings that are not the default"
    screen.print(Table(title, ("setting", "value", ""), rows, labels=3) if rows else "All settings: default")
    screen.write_json({"kind": "scenario", "scenario": scenario.model_dump(mode="json")})
