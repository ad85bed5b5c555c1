"""Scale the laboratory rig's numbers to a crane of another size, as defaults where its file gives none.

Froude's similarity keeps gravity. With a factor L on lengths and M on masses, times and speeds scale by √L,
accelerations stay, and forces scale by M. L is the ratio of the longest ropes, M that of the rated loads. The
load on the larger crane then moves as on the smaller one, slower by √L, and so do the thesis's designs.
"""

from collections.abc import Iterator
from typing import Any

from cranectl.scenario.design import DesignSettings
from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.planning import PlanningSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.run_settings import MetricSettings
from cranectl.scenario.settings import Scaled, Settings
from cranectl.support import InputError, Table, Tree

ROPE_BOUNDS = (0.05, 1000.0)  # [m] range of longest ropes for which all scaled numbers are within bounds
STATED = ("rope_range", "rated_load", "load_mass")  # to which a rig's other numbers are scaled
SCALED_TABLES: dict[str, type[Settings]] = {
    "design": DesignSettings,
    "metrics": MetricSettings,
    "planning": PlanningSettings,
}


def completed_rig(stated: Table) -> Table:
    """Return all parameters of a rig: those in `stated`, and the others scaled to its size.

    Raises InputError for a longest rope to which they cannot be scaled.
    """
    shortest, longest = ROPE_BOUNDS
    rope = stated.get("rope_range", RigParameters().rope_range)[1]
    if not shortest <= rope <= longest:
        raise InputError(
            f"rig.rope_range ends at {rope:g} m",
            allowed=f"longest ropes from {shortest:g} to {longest:g} m, to which a rig's other numbers are "
            "scaled",
            remedy="correct rig.rope_range, or its unit: it is in metres",
        )
    return _completed(RigParameters().model_dump(mode="json"), stated, stated)


def completed_scenario(table: Table, rig: Table) -> Table:
    """Return a scenario's table on its own `rig`, with designs and settling tolerance scaled to it."""
    scaled = {name: settings().model_dump(mode="json") for name, settings in SCALED_TABLES.items()}
    return {**_completed(scaled, rig, table), "rig": rig}


def _completed(laboratory: Table, rig: Table, stated: Table) -> Table:
    """Return `stated` over the numbers of the laboratory, scaled to `rig` to three digits."""
    usual = RigParameters()
    length = rig.get("rope_range", usual.rope_range)[1] / usual.rope_range[1]
    mass = rig.get("rated_load", usual.rated_load) / usual.rated_load
    whole: Table = Tree(laboratory).mapped()
    for name, value in list(Tree(whole).leaves()):
        scale = scale_of(name)
        if scale.factor(length, mass) != 1.0:
            Tree(whole).assign(name, scale.sized(value, length, mass), name)
    completed: Table = Tree(whole).merged(stated)
    return completed


def assumed_settings(rig: RigParameters, effects: EffectSettings) -> set[str]:
    """Return the dotted names of the numbers of a crane and its effects that are as scaled to its size."""
    usual, longest = RigParameters(), rig.rope_range[1]
    of_laboratory = (longest, rig.rated_load) == (usual.rope_range[1], usual.rated_load)
    if of_laboratory or not ROPE_BOUNDS[0] <= longest <= ROPE_BOUNDS[1]:
        return set()
    scaled = completed_rig({"rope_range": list(rig.rope_range), "rated_load": rig.rated_load})
    whole = rig.model_dump(mode="json")
    sources = {"rig.": whole, "": {"effects": effects.model_dump(mode="json")}}
    numbers = {
        f"{prefix}{name}": value for prefix, table in sources.items() for name, value in _numbers(table)
    }
    assumed = {name: value for name, value in _numbers(scaled) if name not in STATED}
    return {
        f"{prefix}{name}"
        for prefix in sources
        for name, value in assumed.items()
        if value and numbers.get(f"{prefix}{name}") == value
    }


def _numbers(table: Table) -> Iterator[tuple[str, Any]]:
    """Yield the lists of a table, and its numbers that scale, by dotted name."""
    for name, value in Tree(table).leaves(is_leaf=lambda value: not isinstance(value, dict)):
        if isinstance(value, list) or scale_of(name) != Scaled():
            yield name, value


def scale_of(name: str) -> Scaled:
    """Return how a number of a rig or of one of SCALED_TABLES scales, by its dotted name."""
    table, _, below = name.partition(".")
    return SCALED_TABLES[table].scale_of(below) if table in SCALED_TABLES else RigParameters.scale_of(name)
