"""Scale the laboratory rig's numbers to a crane of another size, as defaults where its file gives none.

Froude's similarity keeps gravity. With a factor L on lengths and M on masses, times and speeds scale by √L,
accelerations stay, and forces scale by M. L is the ratio of the longest ropes, M that of the rated loads. The
load on the larger crane then moves as on the smaller one, slower by √L, and so do the thesis's designs.
"""

import functools
from collections.abc import Iterator
from typing import Any

from cranectl.scenario.design import DesignSettings
from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.planning import PlanningSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.scenario import MetricSettings
from cranectl.scenario.settings import Scaled, Settings, scales_of
from cranectl.support import InputError, Table, assign, leaves, mapped, merged

ROPE_BOUNDS = (0.05, 1000.0)  # [m] range of longest ropes for which all scaled numbers are within bounds
OVERLOAD = 10.0  # largest load over rated load for which the rig's numbers are accepted
PLAUSIBLE_MASSES = (0.02, 500.0)  # of bridge and trolley over the rated load; real cranes have 0.3 to 50
MAX_STRAIN = 0.5  # of a rope under the weight of its load; steel has 0.002, nylon 0.1
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
    length = length_scale(rig.get("rope_range", usual.rope_range)[1])
    mass = rig.get("rated_load", usual.rated_load) / usual.rated_load
    whole: Table = mapped(laboratory)
    for name, value in list(leaves(whole)):
        scale = scale_of(name)
        factor = length**scale.length * mass**scale.mass
        if factor != 1.0:
            assign(whole, name, rounded(factor * value), name)
    completed: Table = merged(whole, stated)
    return completed


def assumed_settings(rig: RigParameters, effects: EffectSettings) -> set[str]:
    """Return by dotted name the numbers of a crane and its effects that are scaled from the laboratory rig.

    They are found by their values, since a log does not have what was stated. So only lists and numbers that
    scale count: to three digits, what is stated hardly equals them by chance.
    """
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
    for name, value in leaves(table, is_leaf=lambda value: not isinstance(value, dict)):
        if isinstance(value, list) or scale_of(name) != Scaled():
            yield name, value


def scale_of(name: str) -> Scaled:
    """Return how a number of a rig or of one of SCALED_TABLES scales, by its dotted name."""
    scales = _scales()
    return scales.get(name) or scales.get(name.rpartition(".")[0], Scaled())


@functools.cache
def _scales() -> dict[str, Scaled]:
    """Return the annotated scales by name; ratios, angles, seeds, electronics, gravity and air have none."""
    scales = scales_of(RigParameters)
    for table, settings in SCALED_TABLES.items():
        scales |= scales_of(settings, f"{table}.")
    return scales


def length_scale(longest: float) -> float:
    """Return L of a rig whose longest rope is `longest` [m]."""
    return longest / RigParameters().rope_range[1]


def size_of(rig: RigParameters) -> float:
    """Return L of `rig` for the scaling of designs; it is 1 for the laboratory rig's rated load."""
    return 1.0 if rig.rated_load == RigParameters().rated_load else length_scale(rig.rope_range[1])


def rounded(value: float) -> float:
    """Round to the three digits that scaled numbers have."""
    return float(f"{value:.3g}")


def mass_warning(rig: RigParameters) -> str:
    """Return a sentence if bridge and trolley are too heavy or too light for the rated load; else ""."""
    mass = rig.bridge_mass + rig.trolley_mass
    low, high = PLAUSIBLE_MASSES
    if low <= mass / rig.rated_load <= high:
        return ""
    return (
        f"rig.rated_load is {rig.rated_load:g} kg, but bridge and trolley weigh {mass:g} kg: check that all "
        "are in kg, since numbers of the rig that are not given are scaled to the rated load"
    )


def check_size(rig: RigParameters, effects: EffectSettings) -> None:
    """Raise InputError if a rig or its effects have numbers that belong to a crane of another size."""
    if rig.load_mass > OVERLOAD * rig.rated_load:
        raise InputError(
            f"rig.load_mass = {rig.load_mass:g} kg on a crane for rig.rated_load = {rig.rated_load:g} kg",
            allowed=f"loads up to {OVERLOAD:g} times the rated one, to which the rig's other numbers belong",
            remedy="set rig.rated_load; numbers of the rig that are not given are scaled to it",
        )
    weight = rig.hanging_mass(effects) * rig.gravity
    hooked = rig.hanging_mass(effects) > rig.load_mass
    what, verb = ("the load and hook", "weigh") if hooked else ("the load", "weighs")
    if effects.limits and effects.limits.force[2] <= weight:
        raise InputError(
            f"effects.limits.force lets the winch pull {effects.limits.force[2]:g} N, but {what} {verb} "
            f"{weight:g} N",
            allowed=f"a winch that pulls more than {weight:g} N",
            remedy="correct effects.limits.force, or give rig.rated_load, to which it is scaled",
        )
    if effects.rope and weight > MAX_STRAIN * effects.rope.stiffness:
        raise InputError(
            f"effects.rope.stiffness = {effects.rope.stiffness:g} N, a rope that stretches by "
            f"{weight / effects.rope.stiffness:.0%} under {what}'s {weight:g} N",
            allowed=f"E A above {weight / MAX_STRAIN:g} N",
            remedy="correct effects.rope.stiffness, or give rig.rated_load, to which it is scaled",
        )
