"""Read scenarios and rigs from files: find the file of a name, and merge tables in order of precedence.

Also handle what belongs to a scenario but is in no table of it: files of its segments, claims of its plan.
"""

import functools
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from cranectl.scenario.along_path import Plannable
from cranectl.scenario.effects import NO_LIMIT, DriveLimits, EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.run_settings import ControlSettings, controller_table
from cranectl.scenario.scenario import MAX_DEFAULT_STEP, ReferenceSettings, Scenario
from cranectl.scenario.segments import Segment, Spline
from cranectl.scenario.settings import Assigned, override, parse_settings
from cranectl.scenario.similarity import completed_rig, completed_scenario
from cranectl.support import (
    Array,
    InputError,
    Table,
    differences,
    is_plain,
    leaves,
    merged,
    parse_json,
    read_toml,
    replacing,
    resources,
)

OWN = {"name", "title", "duration", "expected", "reference", "disturbances", "controller"}
# The rig's numbers of effects are not reported either: the effects of the run have them.
NOT_REPORTED: dict[str, Any] = {**dict.fromkeys(OWN, True), "rig": {"effects"}}

FOLDER = "reference"
PLAN = f"{FOLDER}/plan.json"  # claims of planned segments, by index
DIGEST_DIGITS = 12  # of a SHA-256


def changed_from_default(scenario: Scenario) -> dict[str, Any]:
    """Return settings that differ from their defaults, by dotted name; skip keys of every scenario."""
    usual_step = ControlSettings(physics_step=scenario.control.physics_step and MAX_DEFAULT_STEP)
    start = ReferenceSettings(start=(0.0, 0.0, 0.0))
    default = Scenario(name="default", duration=1.0, reference=start, control=usual_step)
    usual, requested = (
        settings.model_dump(mode="json", exclude=NOT_REPORTED) for settings in (default, scenario)
    )
    changed = {name: new for name, _, new in differences(usual, requested, absent=None)}
    return dict(leaves(changed, is_leaf=lambda value: not isinstance(value, dict)))


def scenario_names() -> list[str]:
    """Return the names of the shipped scenarios.

    Returns
    -------
    list of str
        The names, sorted.
    """
    return resources.toml_names(resources.SCENARIO_DIRECTORY)


@functools.cache
def _shipped_ranges() -> dict[str, list[list[float]]]:
    return {name: read_scenario(name).rig.workspace.tolist() for name in scenario_names()}


def scenarios_in(workspace: Array) -> str:
    """Return the end of a remedy for points outside a rig's ranges (3, 2) [m]: scenarios made for these."""
    ranges = workspace.tolist()
    names = [name for name, others in _shipped_ranges().items() if others == ranges]
    is_laboratory = ranges == RigParameters().workspace.tolist()  # for which most scenarios are made
    return f"; or take {' or '.join(names)}, made for this rig" if names and not is_laboratory else ""


def scenario_file(name_or_path: str | Path) -> Path:
    """Return the file of a scenario; raise InputError if there is none."""
    return resources.toml_file("scenario", str(name_or_path), resources.SCENARIO_DIRECTORY)


def read_scenario(
    name_or_path: str | Path, *, rig: str | Path | None = None, overrides: Sequence[str] = ()
) -> Scenario:
    """Load a scenario by name or from a TOML file.

    Parameters of the rig come from several sources, and later ones replace earlier ones: the defaults, the
    scenario's `[rig]` or the rig that it names, the file or shipped name `rig`, and `overrides` such as
    `"rig.load_mass=2.5"`. Raises an InputError that names all wrong fields.
    """
    path = scenario_file(name_or_path)
    table = read_toml(path)
    if isinstance(table.get("rig"), dict):
        _place_model(table["rig"], path.parent)
    if rig is None and isinstance(table.get("rig"), str):
        rig = rig_place(table["rig"], path.parent)
    return _scenario(table, path.name, rig, overrides)


def _place_model(rig: Table, directory: Path) -> None:
    """Let the path of the model in a rig's table, read in `directory`, begin at the working directory."""
    if isinstance(rig.get("model"), str):
        rig["model"] = str(rig_place(rig["model"], directory))


def rig_place(name_or_path: str, directory: Path) -> Path:
    """Return the rig that a file in `directory` names, as an argument for `load_rig`."""
    return directory / name_or_path if resources.is_path(name_or_path) else Path(name_or_path)


def load_rig(name_or_path: str | Path) -> RigParameters:
    """Load a shipped rig by its name, or a rig from a TOML file."""
    return parse_settings(RigParameters, rig_table(name_or_path), str(name_or_path))


def rig_names() -> list[str]:
    """Return the names of the shipped rigs."""
    return resources.toml_names(resources.RIG_DIRECTORY)


def rig_table(name_or_path: str | Path) -> Table:
    """Return all parameters of a rig by its name or path; raise InputError for an invalid file.

    Parameters that neither its file nor a file that it extends has are scaled from the laboratory rig.
    """
    return completed_rig(_stated_rig(name_or_path))


def _stated_rig(name_or_path: str | Path) -> Table:
    """Return the parameters of a rig that its file or a file that it extends has."""
    *above, (_, whole) = rig_files(name_or_path)
    if "load_mass" in whole:
        whole = {"rated_load": whole["load_mass"], **whole}
    for _, table in reversed(above):
        whole = merged(whole, table)
    return whole


def rig_files(name_or_path: str | Path) -> Iterator[tuple[Path, Table]]:
    """Yield path and table of the file of a rig, then of each file that it extends, relative to it."""
    below, directory, seen = str(name_or_path), Path(), set[Path]()
    while below is not None:
        path = resources.toml_file("rig", str(rig_place(below, directory)), resources.RIG_DIRECTORY)
        table = read_toml(path)
        if path.resolve() in seen:
            raise InputError(f"{path} extends itself", remedy="remove 'extends' from one of the files")
        below, directory = table.pop("extends", None), path.parent
        parse_settings(RigParameters, table, str(path))
        if not isinstance(below, str | None):
            raise InputError(
                f"{path}: extends = {below!r}",
                allowed="the name of a rig or the path of its file",
                remedy="write it in quotes, such as extends = 'harbour-crane'",
            )
        seen.add(path.resolve())
        _place_model(table, directory)
        yield path, table


def given_settings(
    name_or_path: str | Path | None, rig: str | Path | None, overrides: Sequence[str]
) -> dict[str, Any]:
    """Return by dotted name the settings that the user gives: in the scenario, the rig and the overrides.

    The arguments are those of `read_scenario`, or of `default_scenario` if there is no name. Settings in
    files that come with cranectl do not count.
    """
    table: Table = {}
    shipped = True
    if name_or_path is not None:
        path = scenario_file(name_or_path)
        table, shipped = read_toml(path), path.parent == resources.SCENARIO_DIRECTORY
        if rig is None and isinstance(table.get("rig"), str):
            rig = rig_place(table["rig"], path.parent)
    if rig is not None:
        table = {**table, "rig": {}}
        for path, own in reversed([*rig_files(rig)]):
            if path.parent != resources.RIG_DIRECTORY:
                table["rig"] = merged(table["rig"], own)
    if "controller" in table:
        table = {**table, "controller": controller_table(table["controller"])}
    stated = {
        name for name, _ in _settings(table) if not shipped or (rig is not None and name.startswith("rig."))
    }
    assigned = [assignment.partition("=")[0].strip() for assignment in overrides]
    return {
        name: value
        for name, value in _settings(override(table, overrides))
        if name in stated or any(f"{name}.".startswith(f"{key}.") for key in assigned)
    }


def _settings(table: Table) -> Iterator[tuple[str, Any]]:
    """Yield the values of a table by dotted names, and its empty tables."""
    return leaves(table, is_leaf=lambda value: is_plain(value) or not value)


def idle_effects(scenario: Scenario, stated: Iterable[str]) -> tuple[str, ...]:
    """Return the effects that `scenario` does not have although `stated` sets numbers of the rig for them."""
    named = {name.split(".")[2] for name in stated if name.startswith("rig.effects.")}
    return tuple(
        name
        for name in EffectSettings.model_fields
        if name in named and getattr(scenario.effects, name) is None
    )


def default_scenario(*, rig: str | Path | None = None, overrides: Sequence[str] = ()) -> Scenario:
    """Return a scenario of defaults: the load hangs in the middle of the rig for a second."""
    table = {"name": "default", "duration": 1.0, "reference": {"start": [0.0, 0.0, -1.0]}}
    scenario = _scenario(table, "default scenario", rig, overrides)
    (left, right), (back, front), (shortest, longest) = scenario.rig.workspace.tolist()
    middle = 0.5 * (left + right), 0.5 * (back + front), -max(shortest, 0.5 * longest)
    return scenario.model_copy(update={"reference": ReferenceSettings(start=middle)})


def _scenario(table: Table, source: str, rig: str | Path | None, overrides: Sequence[str]) -> Scenario:
    own, of_rig = table, table.get("rig")
    if rig is not None:
        of_rig = _stated_rig(rig)
        table = completed_scenario(table, completed_rig(of_rig))
    if "controller" in table:
        table = {**table, "controller": controller_table(table["controller"])}
    before = table
    table = override(table, overrides)
    # A table [rig] with a rated load describes another crane, as a rig file does.
    if rig is None and isinstance(table.get("rig"), dict) and "rated_load" in table["rig"]:
        parse_settings(RigParameters, table["rig"], f"{source}: rig", Assigned(overrides, before, "rig."))
        table = completed_scenario(table, completed_rig(table["rig"]))
    assigned = [override({}, [assignment]) for assignment in overrides]
    limited = _limits_in(own, *assigned)
    if limited:
        limited |= _limits_in({"rig": of_rig}, *assigned, below="rig.")
    scenario = parse_settings(Scenario, _with_numbers(table, limited), source, Assigned(overrides, before))
    scenario.rig.check_size(scenario.effects)
    return scenario


def _limits_in(*tables: Table, below: str = "") -> set[str]:
    """Return which limits of the drives are stated in tables of a scenario, or `below` a table of theirs."""
    start = f"{below}effects.limits."
    names = (name for table in tables for name, _ in _settings(table))
    return {name.removeprefix(start).partition(".")[0] for name in names if name.startswith(start)}


def _with_numbers(table: Table, limited: Collection[str]) -> Table:
    """Return the table of a scenario with numbers that its effects lack taken from its rig.

    If the scenario states some limits of the drives, those that neither it nor the rig's file states, which
    `limited` does not name, do not act. An empty table has all limits of the rig.
    """
    rig, effects = table.get("rig"), table.get("effects")
    if not isinstance(effects, dict):
        return table
    numbers = rig.get("effects") if isinstance(rig, dict) else None
    whole = {
        name: merged(numbers.get(name, {}) if isinstance(numbers, dict) else {}, effect)
        for name, effect in effects.items()
        if isinstance(effect, dict)
    }
    if limited and "limits" in whole:
        free = DriveLimits.model_fields.keys() - set(limited)
        whole["limits"] |= {name: [NO_LIMIT] * 3 for name in free}
    return {**table, "effects": {**effects, **whole}}


def held_files(scenario: Scenario) -> dict[str, bytes]:
    """Return the contents of the files that a log of the scenario attaches, by unique names."""
    segments = enumerate(scenario.reference.segments)
    claims = {
        str(k): segment.claim for k, segment in segments if isinstance(segment, Plannable) and segment.claim
    }
    splines = [segment for segment in scenario.reference.segments if isinstance(segment, Spline)]
    files = {_name(spline): spline.held for spline in splines if spline.held}
    return {**files, PLAN: json.dumps(claims).encode()} if claims else files


def with_files(scenario: Scenario, files: Mapping[str, bytes]) -> Scenario:
    """Return a scenario that was read from a table with its `files`, as `held_files` returned them.

    Raises InputError for claims that are not JSON.
    """
    if not files:
        return scenario
    claims = parse_json(files[PLAN], PLAN) if PLAN in files else {}
    known_claims = claims if isinstance(claims, dict) else {}
    segments: list[Segment] = []
    for k, segment in enumerate(scenario.reference.segments):
        if isinstance(segment, Plannable) and isinstance(claim := known_claims.get(str(k)), str):
            segment = segment.claiming(claim)
        if isinstance(segment, Spline) and _name(segment) in files:
            segment = segment.holding(files[_name(segment)])
        segments.append(segment)
    reference = scenario.reference.model_copy(update={"segments": tuple(segments)})
    return scenario.model_copy(update={"reference": reference})


def put_files(directory: Path, scenario: Scenario) -> None:
    """Write the files of `held_files` into `directory`, beside the table of the scenario; raise OSError."""
    for name, content in held_files(scenario).items():
        (directory / FOLDER).mkdir(exist_ok=True)
        with replacing(directory / FOLDER / Path(name).name) as part:
            part.write_bytes(content)


def files_in(directory: Path) -> dict[str, bytes]:
    """Return the files that `put_files` has written, for `with_files`; leave out unreadable ones."""
    contents = {}
    for path in _files(directory):
        with suppress(OSError):
            contents[f"{FOLDER}/{path.name}"] = path.read_bytes()
    return contents


def remove_files(directory: Path) -> None:
    """Remove the files that `put_files` has written."""
    for path in _files(directory):
        path.unlink()
    with suppress(OSError):  # the folder does not exist, or has other files
        (directory / FOLDER).rmdir()


def _files(directory: Path) -> list[Path]:
    paths = (directory / FOLDER).glob(f"{'[0-9a-f]' * DIGEST_DIGITS}-*")
    return sorted(path for path in (*paths, directory / PLAN) if path.is_file())


def _name(spline: Spline) -> str:
    return f"{FOLDER}/{spline.source.held[:DIGEST_DIGITS]}-{spline.source.file}" if spline.source else ""
