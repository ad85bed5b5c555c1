"""What is known to be impossible before anything is solved: what was found, is allowed, is to be done."""

from typing import NoReturn

import numpy as np

from cranectl.reference.planning.limits import Limits, Quantity, motion, quantities, room
from cranectl.reference.planning.proof import NEAR
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

REMEDIES = {
    "load": "move the point, or widen planning.load_box or lessen planning.clearance",
    "bridge": "move the point, or change the rig's range",
    "trolley": "move the point, or change the rig's range",
    "rope": "move the point, or change rig.rope_range",
}


def check_point(point: Array, limits: Limits, what: str) -> None:
    """Raise InputError where the load cannot hang at rest at `point` (x, y, z) [m]."""
    place = ", ".join(f"{value:g}" for value in point)
    still = motion([[np.array([value]), *[np.zeros(1)] * 5] for value in point], limits.gravity)
    for each in quantities(still, limits):
        value = float(each.series[0][0])
        if value > each.high + NEAR or value < each.low - NEAR:
            _cannot_hang(each, value, limits, f"{what}, ({place}),")
    for box in limits.obstacles:
        most = float(room(still, box, limits.radius).max())
        if most < -NEAR:
            raise InputError(
                f"{what}, ({place}), is in the obstacle '{box.name}', or nearer to it than the load's radius "
                f"of {limits.radius:g} m, or the rope is",
                allowed=f"points at least {-most:.3g} m further away, or above "
                f"{box.high[2] + limits.radius:g} m",
                remedy="move the point or the obstacle",
            )


def _cannot_hang(each: Quantity, value: float, limits: Limits, what: str) -> NoReturn:
    subject = each.name.split()[0]
    if each.name.endswith("force"):
        raise InputError(
            f"the winch may pull with {each.high:.3g} N, and the load weighs {-value:.3g} N: "
            "it cannot even be held",
            allowed=f"a load of less than {each.high / limits.gravity:.3g} kg, or a stronger winch",
            remedy="correct rig.load_mass or effects.limits.force, or raise planning.share",
        )
    raise InputError(
        f"{what} is out of reach: there the {each.name} is {value:.4g} m",
        allowed=f"{each.name} from {each.low:.4g} to {each.high:.4g} m",
        remedy=REMEDIES.get(subject, "move the point"),
    )


def check_way_over(height: float, limits: Limits, what: str) -> None:
    """Raise InputError where the load cannot be lifted to `height` [m], over an obstacle."""
    highest = min(float(limits.load[2, 1]), -float(limits.axes[2, 0]))
    if height > highest:
        tallest = max(limits.obstacles, key=lambda box: box.high[2])
        raise InputError(
            f"{what}: no way over the obstacle '{tallest.name}', which ends at z = {tallest.high[2]:g} m: "
            f"the load of radius {limits.radius:g} m would have to be lifted to {height:.3g} m",
            allowed=f"up to {highest:.3g} m: rope_range begins at {limits.axes[2, 0]:g} m, the load's box "
            f"ends at {limits.load[2, 1]:g} m",
            remedy="lower the obstacle, or go round it by points in via",
        )


def no_motion(found: dict[str, float], what: str) -> InputError:
    """For a path on which limits are broken however slowly it is driven."""
    worst = max(found, key=lambda name: found[name])
    return InputError(
        f"{what} cannot be driven however slowly: {worst} is exceeded by {found[worst]:.3g}",
        allowed="a path along which the load can hang at rest everywhere",
        remedy="take kind = 'move', which finds a way, or another path",
    )
