"""Parameters that change nothing: on the chosen plant and drives, or beside another number that is zero.

Effects that a plant cannot show at all are refused by `effects.applicable`. What only happens not to matter
in some runs, such as a limit that is not reached, is no mistake.
"""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

from cranectl.campaign.parameters import Parameter, numbers_of
from cranectl.campaign.settings import CampaignSettings
from cranectl.errors import InputError
from cranectl.scenario import Scenario


class Idle(NamedTuple):
    """Where parameters change nothing; None: everywhere."""

    names: str  # shell pattern
    plant: str | None
    drive: str | None
    why: str


RULES = (
    Idle("rig.*_time_constant", None, "ideal", "ideal drives have no lag"),
    *(
        Idle(f"rig.{body}_mass", plant, drive, why)
        for body in ("bridge", "trolley", "winch")
        for plant, drive, why in (
            (None, "ideal", "ideal drives move as commanded whatever they carry"),
            ("analytic", None, "the drives of the analytic plant know no forces"),
        )
    ),
    Idle("effects.sensing.observer_bandwidth", None, None, "the controller has the observer it was given"),
)

# Parameters that act only where none of these groups is zero in all its numbers.
FACTORS = {
    "effects.wind.mean.*": ("effects.wind.drag_area", "effects.wind.density"),
    "effects.wind.gust": ("effects.wind.drag_area", "effects.wind.density"),
    "effects.wind.gust_time": ("effects.wind.gust", "effects.wind.drag_area", "effects.wind.density"),
    "effects.wind.seed": ("effects.wind.gust", "effects.wind.drag_area", "effects.wind.density"),
    "effects.wind.drag_area": ("effects.wind.density",),
    "effects.wind.density": ("effects.wind.drag_area",),
    "effects.sensing.seed": ("effects.sensing.*_noise*",),
    "disturbances.*.start": ("disturbances.*.magnitude",),
    "disturbances.*.end": ("disturbances.*.magnitude",),
}


def check_acting(settings: CampaignSettings, parameters: Sequence[Parameter], nominal: Scenario) -> None:
    """Raise InputError for a parameter that cannot change the outcome of any run."""
    zero = _always_zero(parameters, nominal)
    for parameter in parameters:
        for plant in settings.plants:
            why = idle_reason(parameter.name, plant, settings.drive, zero)
            if why:
                raise InputError(
                    f"uncertain.{parameter.name} changes nothing on the {plant} plant with "
                    f"{settings.drive} drives: {why}",
                    allowed="parameters that act on every plant of the campaign",
                    remedy="leave it out, or choose other plants or drives",
                )


def idle_reason(name: str, plant: str, drive: str, zero: Mapping[str, bool]) -> str | None:
    """Why `name` changes nothing, None if it does; `zero` tells which numbers are 0 in all runs."""
    for rule in RULES:
        if fnmatchcase(name, rule.names) and rule.plant in (None, plant) and rule.drive in (None, drive):
            return rule.why
    for pattern, factors in FACTORS.items():
        if not fnmatchcase(name, pattern):
            continue
        for factor in factors:
            names = _meant(name, factor, zero)
            if names and all(zero[each] for each in names):
                return f"{', '.join(names)} is 0 in all runs"
    return None


def _meant(name: str, factor: str, numbers: Mapping[str, bool]) -> list[str]:
    """The numbers that `factor` means; of disturbances, those of the disturbance of `name`."""
    if name.startswith("disturbances."):
        factor = factor.replace("*", name.split(".")[1])
    return [number for number in numbers if fnmatchcase(number, factor)]


def _always_zero(parameters: Sequence[Parameter], nominal: Scenario) -> dict[str, bool]:
    """For every number of the scenario, whether it is 0 in all runs."""
    found = {name: value == 0 for name, value in numbers_of(nominal).items()}
    for parameter in parameters:
        found[parameter.name] = parameter.ends == (0.0, 0.0)
    return found
