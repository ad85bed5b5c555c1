"""What an effect is: numbers, and what all but the plants need to know of it."""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Self

from cranectl.scenario.settings import Settings

WHOLE = ("",)  # in place of the names of settings: the effect itself


class Part(NamedTuple):
    """A setting that a plant may lack although it shows the rest of its effect."""

    none: float  # its value, or each of its values, where nothing acts
    tried: float  # to which a plant must react
    on_axes: bool = False  # a force on the driven axes

    def acts(self, value: Any) -> bool:
        """Return True if a value of the setting is not that of nothing."""
        return any(each != self.none for each in (value if isinstance(value, tuple) else (value,)))


def spread(number: float, like: Any) -> Any:
    """Return a number, or as many of it as a setting `like` has."""
    return (number,) * len(like) if isinstance(like, tuple) else number


class Effect(Settings):
    """Numbers of one effect, and what follows from it."""

    adds: ClassVar[str] = ""  # what its level of the ladder adds; without it the ladder has no such level
    is_staged: ClassVar[bool] = False  # lies between plant and controller
    is_structural: ClassVar[bool] = False  # changes the equations of motion smoothly
    linear: ClassVar[tuple[str, ...]] = ()  # settings that the certificate knows; WHOLE for the effect itself
    nonlinear: ClassVar[tuple[str, ...]] = ()  # settings that it leaves out
    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {}  # by setting: what it acts only beside, not at zero
    set_points: ClassVar[Mapping[str, float]] = {}  # settings of set-points, and the value without effect
    parts: ClassVar[Mapping[str, Part]] = {}  # by setting; without them a plant shows the effect or lacks it

    @property
    def linear_part(self) -> Self | None:
        """What of it makes a plant another linear plant."""
        if self.is_staged or not self.linear:
            return None
        return self.model_copy(update={name: spread(0.0, getattr(self, name)) for name in self.nonlinear})
