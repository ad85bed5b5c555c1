"""Refuse what would swing a planar crane's load out of its plane, or change the length of a fixed rope."""

from collections.abc import Iterator, Sequence

from cranectl.scenario.disturbances import Disturbance
from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.run_settings import InitialSettings
from cranectl.scenario.settings import RuleError


def check_fixed_axes(
    rig: RigParameters, initial: InitialSettings, effects: EffectSettings, disturbances: Sequence[Disturbance]
) -> None:
    """Raise RuleError for a setting other than 0 that would move what is fixed."""
    for index, axis in enumerate("xy"):
        if axis in rig.axes:
            continue
        for name, push in _pushes(index, initial, effects, disturbances):
            if push != 0.0:
                raise RuleError(
                    f"{name} = {push:g} on a crane with rig.axes = '{rig.axes}'",
                    allowed=f"a load that swings only along {rig.axes}",
                    remedy=f"set {name} to 0, or rig.axes to 'xy'",
                )
    if rig.rope == "fixed" and (lower := initial.load_offset[2]) != 0.0:
        raise RuleError(
            f"initial.load_offset.2 = {lower:g} on a crane with rig.rope = 'fixed'",
            allowed="a rope of the length that the reference has at its start",
            remedy="set initial.load_offset.2 to 0, or rig.rope to 'hoisted'",
        )


def _pushes(
    index: int, initial: InitialSettings, effects: EffectSettings, disturbances: Sequence[Disturbance]
) -> Iterator[tuple[str, float]]:
    """Yield names and numbers of the settings that move the load along x (index 0) or y (1)."""
    joint, offset = (("beta", initial.beta_offset), ("alpha", initial.alpha_offset))[index]
    yield f"initial.load_offset.{index}", initial.load_offset[index]
    yield f"initial.{joint}_offset", offset
    if effects.wind:
        yield f"effects.wind.mean.{index}", effects.wind.mean[index]
    if effects.installation:
        yield f"effects.installation.tilt.{index}", effects.installation.tilt[index]
    for k, step in enumerate(disturbances):
        alpha, beta = step.acceleration
        yield f"disturbances.{k}.magnitude", (beta, alpha)[index]
        yield f"disturbances.{k}.force.{index}", (step.force or (0.0, 0.0, 0.0))[index]
