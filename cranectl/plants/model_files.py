"""Plants from model files: a command that names `mine.xml` among its plants runs that model as `mine`."""

import os
import re
from collections.abc import Sequence
from pathlib import Path

from cranectl.plants.plant import Drive
from cranectl.plants.registry import (
    ALL,
    MAX_PLANT_LABEL,
    PLANT_COLOURS,
    PLANTS,
    PlantEntry,
    plant_entry,
    plants_to_run,
)
from cranectl.scenario import RigParameters
from cranectl.support import InputError, check_free, check_name, loaded

MODEL_ENDING = ".xml"
OWN_PLANT = "cranectl.plants.mujoco.own_plant:OwnPlant"
BATCH = 16  # as of the shipped model
LACKED = (
    "rope",
    "body",
    "frame",
    "force",
    "friction.pivot_coulomb",
    "friction.pivot_viscous",
    "installation.tilt",
)


def plants_named(names: Sequence[str]) -> tuple[str, ...]:
    """Return the plants that a command names, by name or by model file; raise InputError for an unknown one.

    Models of an earlier command in this process are forgotten.
    """
    forget_models()
    return tuple(PLANTS) if tuple(names) in ALL else tuple(map(plant_named, names))


def plants_for(rig: RigParameters, names: Sequence[str]) -> tuple[str, ...]:
    """Return the plants to run: those in `names`, or the default ones and the model file of the rig."""
    own = () if names or rig.model is None else (plant_named(rig.model),)
    return (*plants_to_run(names), *own)


def plant_named(name: str) -> str:
    """Return the name of the plant that a name or a model file stands for; raise InputError if unknown.

    The plant of a model file has the name of its file, in lower case letters, digits and hyphens. From now on
    this process knows it. Raises InputError if there is no such file, or if another plant has the name.
    """
    if not name.endswith(MODEL_ENDING):
        return plant_entry(name).name
    path = Path(name)
    name = re.sub(r"[^a-z0-9]+", "-", path.stem.lower()).strip("-")
    name = name if name[:1].isalpha() else f"model-{name}".rstrip("-")
    if not path.is_file():
        raise InputError(
            f"no model file {path}",
            allowed=f"names of plants, or an MJCF file, whose name ends in {MODEL_ENDING}",
            remedy="check the path",
        )
    arguments = {"file": str(path.resolve()), "name": name}
    if name in model_plants() and PLANTS[name].arguments["file"] == arguments["file"]:
        return name
    check_name("plant", name)
    check_free("plant", name, PLANTS)
    used = [entry.colour for entry in PLANTS.values()]
    PLANTS[name] = PlantEntry(
        name,
        path.name[-MAX_PLANT_LABEL:],
        next((colour for colour in PLANT_COLOURS if colour not in used), PLANT_COLOURS[-1]),
        OWN_PLANT,
        batch=BATCH,
        drives=("velocity", "force"),
        servos=True,
        lacks=dict.fromkeys(LACKED, "whose model file says what it has"),
        by_default=False,
        arguments=arguments,
    )
    return name


def plant_argument(name: str) -> str:
    """Return the value of `--plants` that means the plant `name`."""
    file = plant_entry(name).arguments.get("file")
    return name if file is None else os.path.relpath(file)


def examine(name: str, rig: RigParameters) -> PlantEntry:
    """Return the entry of a plant, given by name or model file, with what its model has.

    The rig gives the names of sites and actuators. Raises InputError if the model is not a crane.
    """
    entry = plant_entry(plant_named(name))
    if entry.where != OWN_PLANT:
        return entry
    complete: PlantEntry = loaded("cranectl.plants.mujoco.own_plant:examined")(entry, rig.plant.names)
    if complete != entry:
        PLANTS[entry.name] = complete
    return PLANTS[entry.name]


def common_drives(rig: RigParameters, names: Sequence[str], drives: Sequence[Drive]) -> Sequence[Drive]:
    """Return those of `drives` that all plants to run have, or else the last one, which is then refused."""
    entries = [examine(name, rig) for name in plants_for(rig, names)]
    return [drive for drive in drives if all(drive in entry.drives for entry in entries)] or drives[-1:]


def model_plants() -> dict[str, PlantEntry]:
    """Return the plants from model files that this process knows."""
    return {name: entry for name, entry in PLANTS.items() if entry.where == OWN_PLANT}


def forget_models() -> None:
    """Remove the plants from model files."""
    for name in model_plants():
        del PLANTS[name]
