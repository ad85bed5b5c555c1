"""A model file of a user as a plant, stepped by the kernels of the shipped model."""

import copy
import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cranectl.plants.entry import PlantEntry
from cranectl.plants.mujoco.own_check import find_differences
from cranectl.plants.mujoco.own_file import OwnFile
from cranectl.plants.mujoco.own_model import open_model
from cranectl.plants.mujoco.plant import MujocoPlant, views_of
from cranectl.plants.mujoco.sites import SiteViews
from cranectl.plants.plant import Drive
from cranectl.scenario import EffectSettings, ModelNames, RigParameters
from cranectl.support import Array


class OwnPlant(MujocoPlant):
    """A model file as a plant; of the effects it shows the wind, all others are as in the file."""

    def __init__(
        self, rig: RigParameters, *, file: str, name: str, names: ModelNames, drive: Drive, step: float,
        effects: EffectSettings, **timing: Any,
    ) -> None:  # fmt: skip
        self.name, self.drive = name, drive
        self.parameters, self.effects, self._given = rig, EffectSettings(), (rig, effects)
        self.own = own = open_model(Path(file), names)
        self.model = copy.copy(own.model)
        self.model.opt.timestep = step
        self.data = mujoco.MjData(self.model)
        self.rest = own.rest  # where a trial of what it accepts begins
        unused = np.zeros(5, dtype=np.int64)
        sites = self.data.site_xpos
        pivot, load = self.model.site_bodyid[list(own.sites)]
        self.rig = views_of(
            self.model,
            self.data,
            effects,
            step=step,
            bodies=(load, pivot),
            joints=unused,
            rates=unused,
            distance=unused,
            axes=own.axes,
            drives=own.drives,
            scale=own.scale,
            integrates=own.servo == "position",
            load_sensors=own.sensors,
            load_mass=own.load_mass,
            has_body=True,  # disturbances are forces at the site, since hinges may be anywhere
            sites=SiteViews(
                True,
                pivot=sites[own.sites[0]],
                load=sites[own.sites[1]],
                pivot_id=own.sites[0],
                load_id=own.sites[1],
                pivot_motion=np.zeros(6),
                load_motion=np.zeros(6),
                shown=np.zeros(10),
                has_winch=own.has_winch,
                winch_inertia=float(own.driven_masses[-1] - own.load_mass),
                winch_ratio=float(own.ratios[-1]),
            ),
            **timing,
        )

    @functools.cached_property
    def description(self) -> str:
        """The model as run, in MJCF that needs no other file; made once, since each step has it."""
        file = OwnFile(self.own.file, self.own.names)
        file.embed()
        file.spec.option.timestep = self.rig.step
        return str(file.spec.to_xml())

    def retune(self, rig: RigParameters, effects: EffectSettings) -> bool:
        return (rig, effects) == self._given  # no number of the file can be changed

    def _write_state(self, data: mujoco.MjData, state: Array) -> None:
        """Place the model so that its sites show `state` (10,), held by its drives."""
        self.own.pose(data)
        self.own.place(data, state)
        self.own.hold(data)


def examined(entry: PlantEntry, names: ModelNames) -> PlantEntry:
    """Return the entry of a model file with what its model has built in, and how it differs from others.

    Raises InputError if the model is no such crane.
    """
    own = open_model(Path(entry.arguments["file"]), names)
    return replace(
        entry,
        arguments={**entry.arguments, "names": names},
        digest=own.digest,
        drives=("force" if own.servo == "force" else "velocity",),
        fixed=own.built_in,
        delay=own.delay,
        differs=", ".join(
            f"{difference.text}{f' ({difference.line})' * bool(difference.line)}"
            for difference in find_differences(own)
        ),
    )
