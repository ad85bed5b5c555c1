"""What a crane of another size has where nothing is said: the laboratory rig's numbers, scaled.

Froude's similarity, which keeps gravity: with lengths by a factor L and masses by M, times go by √L, speeds
by √L, accelerations stay, forces go by M. L is that of the longest rope, M that of the rated load. A
pendulum on the larger crane then moves as on the smaller one, slower by √L, and so do the thesis's designs.
"""

from cranectl.scenario.design import DesignSettings
from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.planning import PlanningSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.scenario import MetricSettings
from cranectl.support.documents import Table, assign, leaves, mapped, merged
from cranectl.support.errors import InputError

OVERLOAD = 10.0  # load over rated load beyond which a rig's numbers are taken for those of another one
MOST_STRAIN = 0.5  # of a rope under the weight of its load; of steel 0.002, of nylon 0.1

# Powers of length and mass; what is not listed (ratios, angles, seeds, electronics, gravity, air) stays.
POWERS: dict[str, tuple[float, float]] = {
    "bridge_range": (1.0, 0.0),
    "trolley_range": (1.0, 0.0),
    "rope_range": (1.0, 0.0),
    "bridge_mass": (0.0, 1.0),
    "trolley_mass": (0.0, 1.0),
    "winch_mass": (0.0, 1.0),
    "load_mass": (0.0, 1.0),
    "rated_load": (0.0, 1.0),
    "bridge_time_constant": (0.5, 0.0),
    "trolley_time_constant": (0.5, 0.0),
    "winch_time_constant": (0.5, 0.0),
    "effects.limits.velocity": (0.5, 0.0),
    "effects.limits.force": (0.0, 1.0),
    "effects.sensing.position_resolution": (1.0, 0.0),
    "effects.sensing.position_noise": (1.0, 0.0),
    "effects.sensing.observer_bandwidth": (-0.5, 0.0),
    "effects.friction.coulomb": (0.0, 1.0),
    "effects.friction.viscous": (-0.5, 1.0),
    "effects.friction.pivot_coulomb": (1.0, 1.0),
    "effects.friction.pivot_viscous": (1.5, 1.0),
    "effects.rope.stiffness": (0.0, 1.0),
    "effects.rope.mass": (-1.0, 1.0),
    "effects.body.hook_offset": (1.0, 0.0),
    "effects.body.inertia": (2.0, 1.0),
    "effects.body.swing_damping": (1.5, 1.0),
    "effects.wind.gust": (0.5, 0.0),
    "effects.wind.gust_time": (0.5, 0.0),
    "effects.wind.drag_area": (-1.0, 1.0),
    "effects.frame.frequency": (-0.5, 0.0),
    "effects.frame.mass": (0.0, 1.0),
    "metrics.settling_tolerance": (1.0, 0.0),
    "planning.clearance": (1.0, 0.0),
    # Of chains z⁗ = v: frequencies by 1/√L, so gains by powers of it.
    "design.poles": (-0.5, 0.0),
    "design.state_weights.0": (-4.0, 0.0),
    "design.state_weights.1": (-3.0, 0.0),
    "design.state_weights.2": (-2.0, 0.0),
    "design.state_weights.3": (-1.0, 0.0),
    "design.hinf.bandwidth": (-0.5, 0.0),
    "design.hinf.control_weight": (2.0, 0.0),
    "design.loop_shaping.proportional": (-2.0, 0.0),
    "design.loop_shaping.integral": (-2.5, 0.0),
}


def completed_rig(given: Table) -> Table:
    """All parameters of a rig: those in `given`, the others scaled to it."""
    return _completed(RigParameters().model_dump(mode="json"), given, given)


def completed_scenario(table: Table, rig: Table) -> Table:
    """The table of a scenario on a `rig` of its own: designs and the settling tolerance scaled to it."""
    usual = {"design": DesignSettings(), "metrics": MetricSettings(), "planning": PlanningSettings()}
    scaled = {name: settings.model_dump(mode="json") for name, settings in usual.items()}
    return {**_completed(scaled, rig, table), "rig": rig}


def _completed(laboratory: Table, rig: Table, given: Table) -> Table:
    """`given` on top of the numbers of the laboratory, scaled to `rig` to three digits."""
    usual = RigParameters()
    length = length_scale(rig.get("rope_range", usual.rope_range)[1])
    mass = rig.get("rated_load", usual.rated_load) / usual.rated_load
    whole: Table = mapped(laboratory)
    for name, value in list(leaves(whole)):
        by_length, by_mass = POWERS.get(name) or POWERS.get(name.rpartition(".")[0], (0.0, 0.0))
        factor = length**by_length * mass**by_mass
        if factor != 1.0:
            assign(whole, name, rounded(factor * value), name)
    completed: Table = merged(whole, given)
    return completed


def length_scale(longest: float) -> float:
    """L of a rig with so long a rope [m]."""
    return longest / RigParameters().rope_range[1]


def size_of(rig: RigParameters) -> float:
    """L of `rig` as designs are scaled to it: 1 for a crane of the laboratory rig's rated load."""
    return 1.0 if rig.rated_load == RigParameters().rated_load else length_scale(rig.rope_range[1])


def rounded(value: float) -> float:
    """To the three digits that scaled numbers have."""
    return float(f"{value:.3g}")


def check_size(rig: RigParameters, effects: EffectSettings) -> None:
    """Raise InputError where a rig or effects on it have numbers of a crane of another size."""
    if rig.load_mass > OVERLOAD * rig.rated_load:
        raise InputError(
            f"rig.load_mass = {rig.load_mass:g} kg on a crane for rig.rated_load = {rig.rated_load:g} kg",
            allowed=f"loads up to {OVERLOAD:g} times the rated one: the rig's other numbers are of its size",
            remedy="give rig.rated_load, and what is not said of the rig is scaled to it",
        )
    if effects.limits and effects.limits.force[2] <= rig.weight:
        raise InputError(
            f"effects.limits.force lets the winch pull {effects.limits.force[2]:g} N, and the load weighs "
            f"{rig.weight:g} N",
            allowed=f"a winch that pulls more than {rig.weight:g} N",
            remedy="correct effects.limits.force, or give rig.rated_load, to which it is scaled",
        )
    if effects.rope and rig.weight > MOST_STRAIN * effects.rope.stiffness:
        raise InputError(
            f"effects.rope.stiffness = {effects.rope.stiffness:g} N, a rope that stretches by "
            f"{rig.weight / effects.rope.stiffness:.0%} under the load's {rig.weight:g} N",
            allowed=f"E A above {rig.weight / MOST_STRAIN:g} N",
            remedy="correct effects.rope.stiffness, or give rig.rated_load, to which it is scaled",
        )
