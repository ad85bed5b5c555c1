"""A model file of a user as a plant, stepped by the kernels of the shipped model."""

import copy
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from cranectl.plants.mujoco.disturbed_step import stage_work
from cranectl.plants.mujoco.own_check import find_differences
from cranectl.plants.mujoco.own_file import spec_of_file
from cranectl.plants.mujoco.own_model import OwnModel, hold, open_model, place
from cranectl.plants.mujoco.plant import MujocoPlant, MujocoRig
from cranectl.plants.mujoco.rope import elastic_rope
from cranectl.plants.mujoco.sites import SiteViews
from cranectl.plants.plant import Drive
from cranectl.plants.registry import PlantEntry
from cranectl.plants.surroundings import air_drag
from cranectl.scenario.effects import NO_EFFECTS, EffectSettings
from cranectl.scenario.rig import ModelNames, RigParameters
from cranectl.support.arrays import Array

DIGITS = 6  # of masses and time constants, which users copy from messages
LEAST_STATED_MASS = 1e-6  # [kg] that a rig can state, for a winch without inertia


class OwnPlant(MujocoPlant):
    """A model file as a plant; of the effects it shows the wind, all others are as in the file."""

    def __init__(
        self,
        rig: RigParameters,
        *,
        file: str,
        name: str,
        drive: Drive,
        step: float,
        substeps: int,
        effects: EffectSettings,
    ) -> None:
        self.name, self.drive = name, drive
        self.parameters, self.effects, self._given = rig, NO_EFFECTS, (rig, effects)
        self.own = own = open_model(Path(file), rig.plant.names)
        self.model = copy.copy(own.model)
        self.model.opt.timestep = step
        self.data = data = mujoco.MjData(self.model)
        pivot, load = own.sites
        bodies = self.model.site_bodyid
        unused = np.zeros(5, dtype=np.int64)
        self.rig = MujocoRig(
            model=self.model._address,
            data=data._address,
            qpos=data.qpos,
            qvel=data.qvel,
            ctrl=data.ctrl,
            applied=data.qfrc_applied,
            sensors=data.sensordata,
            joints=unused,
            rates=unused,
            distance=unused[:2],
            drives=own.drives,
            scale=own.scale,
            integrates=own.servo == "position",
            load_sensors=own.sensors,
            warnings=data.warning.number,
            load_mass=own.load_mass,
            air=np.zeros(3),
            wrench=data.xfrc_applied[bodies[load]],
            reaction=data.xfrc_applied[bodies[pivot]],
            has_body=True,
            sites=SiteViews(
                True,
                pivot=data.site_xpos[pivot],
                load=data.site_xpos[load],
                centre=data.xipos[bodies[load]],
                pivot_id=pivot,
                load_id=load,
                pivot_motion=np.zeros(6),
                load_motion=np.zeros(6),
                shown=np.zeros(10),
                height=own.height,
                winch_inertia=float(own.driven_masses[2] - own.load_mass),
                winch_ratio=float(own.ratios[2]),
            ),
            rope=elastic_rope(self.model, NO_EFFECTS),
            in_air=effects.wind is not None,
            drag=air_drag(effects),
            work=stage_work(self.model, data, sensors=len(own.sensors)),
            substeps=substeps,
            step=step,
        )

    @property
    def description(self) -> str:
        """The model as run, in MJCF."""
        spec = spec_of_file(self.own.file, self.parameters.plant.names)
        spec.option.timestep = self.rig.step
        return str(spec.to_xml())

    def retune(self, rig: RigParameters, effects: EffectSettings) -> bool:
        return (rig, effects) == self._given

    def check_length(self, length: float) -> None:
        """Allow every rope: its shortest one is a matter of the model."""

    def _write_state(self, data: mujoco.MjData, state: Array) -> None:
        """Place the model so that its sites show `state` (10,), held by its drives."""
        place(self.model, data, self.own.sites, state)
        hold(self.own, self.model, data)


def examined(entry: PlantEntry, names: ModelNames) -> PlantEntry:
    """Return the entry of a model file with what its model has built in, and how it differs from others.

    Raises InputError if the model is no such crane.
    """
    file = Path(entry.arguments["file"])
    own, differences = open_model(file, names), find_differences(file, names)
    return replace(
        entry,
        drives=("force" if own.servo == "force" else "velocity",),
        fixed=built_in(own),
        differs=", ".join(finding.text for finding in differences),
    )


def built_in(own: OwnModel) -> dict[str, float]:
    """Return the numbers of the rig that a model has, by their names in a rig."""
    masses = own.driven_masses[0] - own.driven_masses[1], own.driven_masses[1]
    numbers = {
        "gravity": own.gravity,
        "bridge_mass": masses[0],
        "trolley_mass": masses[1],
        "winch_mass": max(own.driven_masses[2] - own.load_mass, LEAST_STATED_MASS),
        "load_mass": own.load_mass,
    }
    if own.servo == "velocity":
        lags = zip(("bridge", "trolley", "winch"), own.time_constants, strict=True)
        numbers |= {f"{axis}_time_constant": lag for axis, lag in lags}
    return {name: float(f"{number:.{DIGITS}g}") for name, number in numbers.items()}
