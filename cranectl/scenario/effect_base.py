"""What all effects have in common: numbers, and what of them a plant or the certificate may leave out."""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Self

from cranectl.scenario.settings import Settings


class Part(NamedTuple):
    """A setting that a plant may lack although it shows the rest of its effect."""

    none: float  # value, for each axis, at which the setting has no effect
    tried: float  # value to which a plant must react in a test
    on_axes: bool = False  # whether it is a force on the driven axes

    def acts(self, value: Any) -> bool:
        """Return True if a value of the setting has an effect."""
        return any(number != self.none for number in (value if isinstance(value, tuple) else (value,)))


class Effect(Settings):
    """Numbers of an effect, and its properties."""

    adds: ClassVar[str] = ""  # what its level of the ladder adds; empty if the ladder has no such level
    is_staged: ClassVar[bool] = False  # whether it acts between plant and controller
    is_structural: ClassVar[bool] = False  # whether it changes the equations of motion smoothly
    linear: ClassVar[tuple[str, ...]] = ()  # settings that the certificate includes; WHOLE for all
    nonlinear: ClassVar[tuple[str, ...]] = ()  # settings that the certificate leaves out; WHOLE for all
    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {}  # by setting: others without which it has no effect
    set_points: ClassVar[Mapping[str, float]] = {}  # settings of set-points, and their value without effect
    parts: ClassVar[Mapping[str, Part]] = {}  # by setting; if empty, a plant shows or lacks the whole effect

    def with_numbers(self, numbers: Mapping[str, float]) -> Self:
        """Return the effect with `numbers` by setting, each for all axes if the setting is a list."""
        update: dict[str, Any] = dict(numbers)
        for name, stated in ((name, getattr(self, name)) for name in numbers):
            if isinstance(stated, tuple):
                update[name] = (numbers[name],) * len(stated)
        return self.model_copy(update=update)

    @property
    def linear_part(self) -> Self | None:
        """The effect with only those settings that keep a plant linear, or None if there are none."""
        if self.is_staged or not self.linear:
            return None
        return self.with_numbers(dict.fromkeys(self.nonlinear, 0.0))
