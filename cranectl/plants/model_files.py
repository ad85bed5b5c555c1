"""Plants from model files: a command that names `mine.xml` among its plants runs that model as `mine`."""

import re
from collections.abc import Sequence
from pathlib import Path

from cranectl.plants.registry import (
    MAX_PLANT_LABEL,
    OWN_PLANT,
    PLANT_COLOURS,
    PLANTS,
    REFERENCE_PLANT,
    PlantEntry,
)
from cranectl.scenario import RigParameters
from cranectl.support import InputError, check_free, check_name, loaded

MODEL_ENDING = ".xml"  # of a model file in MJCF
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
    PLANTS.forget_model_files()
    return tuple(PLANTS) if tuple(names) in PLANTS.ALL else tuple(map(plant_named, names))


def plants_for(rig: RigParameters, names: Sequence[str]) -> tuple[str, ...]:
    """Return the plants to run: those in `names`, or the default ones and the model file of the rig."""
    own = () if names or rig.model is None else (plant_named(rig.model),)
    return (*PLANTS.to_run(names), *own)


def plant_named(name: str) -> str:
    """Return the name of the plant that a name or a model file stands for; raise InputError if unknown.

    The plant of a model file has the name of its file, in lower case letters, digits and hyphens. From now on
    this process knows it. Raises InputError if there is no such file, or if another plant has the name.
    """
    if not name.endswith(MODEL_ENDING):
        return PLANTS.entry(name).name
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
    if name in PLANTS.model_files and PLANTS[name].arguments["file"] == arguments["file"]:
        return name
    check_name("plant", name)
    check_free("plant", name, PLANTS)
    used = [entry.colour for entry in PLANTS.values()]
    PLANTS[name] = PlantEntry(
        name,
        path.name[-MAX_PLANT_LABEL:],
        next((colour for colour in PLANT_COLOURS if colour not in used), PLANT_COLOURS[-1]),
        OWN_PLANT,
        batch=PLANTS[REFERENCE_PLANT].batch,
        drives=("velocity", "force"),
        servos=True,
        lacks=dict.fromkeys(LACKED, "whose model file says what it has"),
        by_default=False,
        arguments=arguments,
    )
    return name


def examine(name: str, rig: RigParameters) -> PlantEntry:
    """Return the entry of a plant, given by name or model file, with what its model has.

    The rig gives the names of sites and actuators. Raises InputError if the model is not a crane.
    """
    entry = PLANTS.entry(plant_named(name))
    if not entry.is_model_file:
        return entry
    complete: PlantEntry = loaded("cranectl.plants.mujoco.own_plant:examined")(entry, rig.plant.names)
    if complete != entry:
        PLANTS[entry.name] = complete
    return PLANTS[entry.name]
