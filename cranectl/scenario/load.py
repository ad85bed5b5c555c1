"""Scenarios and rigs from files: which file a name means, what comes on top of what."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.scenario import ReferenceSettings, Scenario, controller_table
from cranectl.scenario.settings import override, parse_settings
from cranectl.scenario.similarity import check_size, completed_rig, completed_scenario
from cranectl.support import resources
from cranectl.support.documents import Table, differences, is_plain, leaves, merged, read_toml
from cranectl.support.errors import InputError

OWN = {"name", "title", "duration", "expected", "reference", "disturbances", "controller"}
# And what effects would be on the rig: those that a run has say it themselves.
NOT_TOLD: dict[str, Any] = {**dict.fromkeys(OWN, True), "rig": {"effects"}}


def changed_from_default(scenario: Scenario) -> dict[str, Any]:
    """By dotted name, what but OWN, of which every scenario has its own, is not the default."""
    default = Scenario(name="default", duration=1.0, reference=ReferenceSettings(start=(0.0, 0.0, 0.0)))
    usual, asked = (each.model_dump(mode="json", exclude=NOT_TOLD) for each in (default, scenario))
    changed = {name: new for name, _, new in differences(usual, asked, absent=None)}
    return dict(leaves(changed, is_leaf=lambda value: not isinstance(value, dict)))


def scenario_names() -> list[str]:
    """Names of the scenarios that come with cranectl."""
    return resources.toml_names(resources.SCENARIO_DIRECTORY)


def scenario_file(name_or_path: str | Path) -> Path:
    """Where a scenario is read; raises InputError for none."""
    return resources.toml_file("scenario", str(name_or_path), resources.SCENARIO_DIRECTORY)


def read_scenario(
    name_or_path: str | Path, *, rig: str | Path | None = None, overrides: Sequence[str] = ()
) -> Scenario:
    """Load a scenario by name or from a TOML file.

    Rig parameters: defaults, then the scenario's `[rig]`, or the rig that it names, then those of `rig`, a
    file or the name of one that comes with cranectl, then `overrides` (`"rig.load_mass=2.5"`). Raises
    InputError for anything wrong, naming all wrong fields.
    """
    path = scenario_file(name_or_path)
    table = read_toml(path)
    if rig is None and isinstance(table.get("rig"), str):
        rig = rig_place(table["rig"], path.parent)
    return _scenario(table, path.name, rig, overrides)


def rig_place(name_or_path: str, directory: Path) -> Path:
    """A rig that a file in `directory` names, as `load_rig` takes it."""
    return directory / name_or_path if resources.is_path(name_or_path) else Path(name_or_path)


def load_rig(name_or_path: str | Path) -> RigParameters:
    """A rig that comes with cranectl, by its name, or from a TOML file."""
    return parse_settings(RigParameters, rig_table(name_or_path), str(name_or_path))


def rig_names() -> list[str]:
    """Names of the rigs that come with cranectl."""
    return resources.toml_names(resources.RIG_DIRECTORY)


def rig_table(name_or_path: str | Path) -> Table:
    """All parameters of a rig by its name or path; raises InputError.

    What neither its file nor one that it extends says is scaled from the laboratory rig.
    """
    return completed_rig(_given(str(name_or_path), Path()))


def given_settings(
    name_or_path: str | Path | None, rig: str | Path | None, overrides: Sequence[str]
) -> dict[str, Any]:
    """Return by dotted name what the user says of a scenario, in its file, in its rig's and by overrides.

    The arguments are those of `read_scenario`, or for `default_scenario` without a name. What comes with
    cranectl does not count.
    """
    table: Table = {}
    shipped = True
    if name_or_path is not None:
        path = scenario_file(name_or_path)
        table, shipped = read_toml(path), path.parent == resources.SCENARIO_DIRECTORY
        if rig is None and isinstance(table.get("rig"), str):
            rig = rig_place(table["rig"], path.parent)
    if rig is not None:
        table = {**table, "rig": _own_rig(str(rig), Path())}
    if "controller" in table:
        table = {**table, "controller": controller_table(table["controller"])}
    given = {name for name, _ in _said(table) if not shipped or (rig is not None and name.startswith("rig."))}
    asked = [assignment.partition("=")[0].strip() for assignment in overrides]
    return {
        name: value
        for name, value in _said(override(table, overrides))
        if name in given or any(f"{name}.".startswith(f"{key}.") for key in asked)
    }


def _said(table: Table) -> Iterator[tuple[str, Any]]:
    """Yield the values of a table by dotted names, and its empty tables."""
    return leaves(table, is_leaf=lambda value: is_plain(value) or not value)


def idle_effects(scenario: Scenario, given: Iterable[str]) -> tuple[str, ...]:
    """Return the effects that `scenario` does not have, but its rig has numbers of among `given`."""
    named = {name.split(".")[2] for name in given if name.startswith("rig.effects.")}
    return tuple(
        name
        for name in EffectSettings.model_fields
        if name in named and getattr(scenario.effects, name) is None
    )


def _own_rig(name_or_path: str, directory: Path) -> Table:
    """Return what a rig's file says and those of the user's that it extends."""
    path = resources.toml_file("rig", str(rig_place(name_or_path, directory)), resources.RIG_DIRECTORY)
    if path.parent == resources.RIG_DIRECTORY:
        return {}
    table = read_toml(path)
    below = _own_rig(table["extends"], path.parent) if "extends" in table else {}
    whole: Table = merged(below, {name: value for name, value in table.items() if name != "extends"})
    return whole


def _given(name_or_path: str, directory: Path, above: tuple[Path, ...] = ()) -> Table:
    """What the file of a rig says, on top of the one that it `extends`, by a path from its own place."""
    path = resources.toml_file("rig", str(rig_place(name_or_path, directory)), resources.RIG_DIRECTORY)
    table = read_toml(path)
    if path.resolve() in above:
        raise InputError(f"{path} extends itself", remedy="remove 'extends' from one of the files")
    below = table.pop("extends", None)
    parse_settings(RigParameters, table, str(path))
    if below is None:
        return {"rated_load": table["load_mass"], **table} if "load_mass" in table else table
    if not isinstance(below, str):
        raise InputError(
            f"{path}: extends = {below!r}",
            allowed="the name of a rig or the path of its file",
            remedy="write it in quotes, such as extends = 'harbour-crane'",
        )
    whole: Table = merged(_given(below, path.parent, (*above, path.resolve())), table)
    return whole


def default_scenario(*, rig: str | Path | None = None, overrides: Sequence[str] = ()) -> Scenario:
    """A scenario of defaults: the load hangs in the middle of the rig for a second."""
    table = {"name": "default", "duration": 1.0, "reference": {"start": [0.0, 0.0, -1.0]}}
    scenario = _scenario(table, "default scenario", rig, overrides)
    (left, right), (back, front), (shortest, longest) = scenario.rig.workspace.tolist()
    middle = 0.5 * (left + right), 0.5 * (back + front), -max(shortest, 0.5 * longest)
    return scenario.model_copy(update={"reference": ReferenceSettings(start=middle)})


def _scenario(table: Table, source: str, rig: str | Path | None, overrides: Sequence[str]) -> Scenario:
    if rig is not None:
        table = completed_scenario(table, rig_table(rig))
    if "controller" in table:
        table = {**table, "controller": controller_table(table["controller"])}
    table = override(table, overrides)
    if (
        rig is None and isinstance(table.get("rig"), dict) and "rated_load" in table["rig"]
    ):  # another crane, as in a file
        parse_settings(RigParameters, table["rig"], f"{source}: rig")
        table = completed_scenario(table, completed_rig(table["rig"]))
    scenario = parse_settings(Scenario, _with_numbers(table), source)
    check_size(scenario.rig, scenario.effects)
    return scenario


def _with_numbers(table: Table) -> Table:
    """The table of a scenario whose effects have, where they say nothing, the numbers of its rig."""
    rig, effects = table.get("rig"), table.get("effects")
    numbers = rig.get("effects") if isinstance(rig, dict) else None
    if not isinstance(numbers, dict) or not isinstance(effects, dict):
        return table
    whole = {
        name: merged(numbers.get(name, {}), effect)
        for name, effect in effects.items()
        if isinstance(effect, dict)
    }
    return {**table, "effects": {**effects, **whole}}
