"""Read scenarios and rigs from files: find the file of a name, and merge tables in order of precedence."""

import functools
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

from cranectl.scenario.effects import DriveLimits
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.run_settings import controller_table
from cranectl.scenario.scenario import ReferenceSettings, Scenario
from cranectl.scenario.settings import override
from cranectl.scenario.similarity import completed_rig, completed_scenario
from cranectl.support import TOML, Array, InputError, Shipped, Table, Tree


def scenario_names() -> list[str]:
    """Return the names of the shipped scenarios.

    Returns
    -------
    list of str
        The names, sorted.
    """
    return Shipped.SCENARIOS.names()


@functools.cache
def _shipped_ranges() -> dict[str, list[list[float]]]:
    return {name: ScenarioFile.read(name).rig.workspace.tolist() for name in scenario_names()}


class ScenarioFile:
    """The file of a scenario: found by its name, read, and what of it the user gave."""

    @staticmethod
    def made_for(workspace: Array) -> str:
        """Return the end of a remedy for points outside a rig's ranges (3, 2) [m]: other scenarios."""
        ranges = workspace.tolist()
        names = [name for name, others in _shipped_ranges().items() if others == ranges]
        is_laboratory = ranges == RigParameters().workspace.tolist()  # for which most scenarios are made
        return f"; or take {' or '.join(names)}, made for this rig" if names and not is_laboratory else ""

    @staticmethod
    def find(name_or_path: str | Path) -> Path:
        """Return the file of a scenario; raise InputError if there is none."""
        return Shipped.SCENARIOS.file(str(name_or_path))

    @staticmethod
    def read(
        name_or_path: str | Path | None, *, rig: str | Path | None = None, overrides: Sequence[str] = ()
    ) -> Scenario:
        """Load a scenario by name or from a TOML file, or the default scenario if there is no name.

        Parameters of the rig come from several sources, and later ones replace earlier ones: the defaults,
        the scenario's `[rig]` or the rig that it names, the file or shipped name `rig`, and `overrides` such
        as `"rig.load_mass=2.5"`. Raises an InputError that names all wrong fields.
        """
        if name_or_path is None:
            return default_scenario(rig=rig, overrides=overrides)
        path = ScenarioFile.find(name_or_path)
        table = TOML.read(path)
        if isinstance(table.get("rig"), dict):
            _place_model(table["rig"], path.parent)
        if rig is None and isinstance(table.get("rig"), str):
            rig = RigFile.place(table["rig"], path.parent)
        return _scenario(table, path.name, rig, overrides)

    @staticmethod
    def given_settings(
        name_or_path: str | Path | None, rig: str | Path | None, overrides: Sequence[str]
    ) -> dict[str, Any]:
        """Return by dotted name the settings that the user gives: in the scenario, the rig and the overrides.

        The arguments are those of `read`. Settings in files that come with cranectl do not
        count.
        """
        table: Table = {}
        shipped = True
        if name_or_path is not None:
            path = ScenarioFile.find(name_or_path)
            table, shipped = TOML.read(path), path.parent == Shipped.SCENARIOS.folder
            if rig is None and isinstance(table.get("rig"), str):
                rig = RigFile.place(table["rig"], path.parent)
        if rig is not None:
            table = {**table, "rig": {}}
            for path, own in reversed([*rig_files(rig)]):
                if path.parent != Shipped.RIGS.folder:
                    table["rig"] = Tree(table["rig"]).merged(own)
        if "controller" in table:
            table = {**table, "controller": controller_table(table["controller"])}
        stated = {
            name
            for name, _ in _settings(table)
            if not shipped or (rig is not None and name.startswith("rig."))
        }
        assigned = [assignment.partition("=")[0].strip() for assignment in overrides]
        return {
            name: value
            for name, value in _settings(override(table, overrides))
            if name in stated or any(f"{name}.".startswith(f"{key}.") for key in assigned)
        }


def _place_model(rig: Table, directory: Path) -> None:
    """Let the path of the model in a rig's table, read in `directory`, begin at the working directory."""
    if isinstance(rig.get("model"), str):
        rig["model"] = str(RigFile.place(rig["model"], directory))


class RigFile:
    """The file of a rig: found by its name, and read."""

    @staticmethod
    def place(name_or_path: str, directory: Path) -> Path:
        """Return the rig that a file in `directory` names, as an argument for `load`."""
        return directory / name_or_path if Shipped.is_path(name_or_path) else Path(name_or_path)

    @staticmethod
    def load(name_or_path: str | Path) -> RigParameters:
        """Load a shipped rig by its name, or a rig from a TOML file."""
        return RigParameters.from_table(rig_table(name_or_path), str(name_or_path))

    @staticmethod
    def names() -> list[str]:
        """Return the names of the shipped rigs."""
        return Shipped.RIGS.names()


def rig_table(name_or_path: str | Path) -> Table:
    """Return all parameters of a rig by its name or path; raise InputError for an invalid file.

    Parameters that neither its file nor a file that it extends has are scaled from the laboratory rig.
    """
    return completed_rig(_stated_rig(name_or_path))


def _stated_rig(name_or_path: str | Path) -> Table:
    """Return the parameters of a rig that its file or a file that it extends has."""
    *above, (_, whole) = rig_files(name_or_path)
    if "load_mass" in whole:
        whole = {"rated_load": whole["load_mass"], **whole}  # a rated load that the file has counts
    for _, table in reversed(above):
        whole = Tree(whole).merged(table)
    return whole


def rig_files(name_or_path: str | Path) -> Iterator[tuple[Path, Table]]:
    """Yield path and table of the file of a rig, then of each file that it extends, relative to it."""
    below, directory, seen = str(name_or_path), Path(), set[Path]()
    while below is not None:
        path = Shipped.RIGS.file(str(RigFile.place(below, directory)))
        table = TOML.read(path)
        if path.resolve() in seen:
            raise InputError(f"{path} extends itself", remedy="remove 'extends' from one of the files")
        below, directory = table.pop("extends", None), path.parent
        RigParameters.from_table(table, str(path))  # checks this file alone
        if not isinstance(below, str | None):
            raise InputError(
                f"{path}: extends = {below!r}",
                allowed="the name of a rig or the path of its file",
                remedy="write it in quotes, such as extends = 'harbour-crane'",
            )
        seen.add(path.resolve())
        _place_model(table, directory)
        yield path, table


def _settings(table: Table) -> Iterator[tuple[str, Any]]:
    """Yield the values of a table by dotted names, and its empty tables."""
    return Tree(table).leaves(is_leaf=lambda value: Tree(value).is_plain or not value)


def default_scenario(*, rig: str | Path | None = None, overrides: Sequence[str] = ()) -> Scenario:
    """Return a scenario of defaults: the load hangs in the middle of the rig for a second."""
    table = {"name": "default", "duration": 1.0, "reference": {"start": [0.0, 0.0, -1.0]}}
    scenario = _scenario(table, "default scenario", rig, overrides)
    (left, right), (back, front), (shortest, longest) = scenario.rig.workspace.tolist()
    middle = 0.5 * (left + right), 0.5 * (back + front), -max(shortest, 0.5 * longest)
    # The middle is known only now, from the rig.
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
        RigParameters.from_table(
            table["rig"], f"{source}: rig", overrides=overrides, before=before, prefix="rig."
        )
        table = completed_scenario(table, completed_rig(table["rig"]))
    assigned = [override({}, [assignment]) for assignment in overrides]
    limited = _limits_in(own, *assigned)
    if limited:
        limited |= _limits_in({"rig": of_rig}, *assigned, below="rig.")
    scenario = Scenario.from_table(_with_numbers(table, limited), source, overrides=overrides, before=before)
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
        name: Tree(numbers.get(name, {}) if isinstance(numbers, dict) else {}).merged(effect)
        for name, effect in effects.items()
        if isinstance(effect, dict)
    }
    if limited and "limits" in whole:
        free = DriveLimits.model_fields.keys() - set(limited)
        whole["limits"] |= {name: [DriveLimits.NO_LIMIT] * 3 for name in free}
    return {**table, "effects": {**effects, **whole}}
