"""Plants from model files: a command that names `mine.xml` among its plants runs that model as `mine`."""

import re
from collections.abc import Sequence
from pathlib import Path

from cranectl.plants.registry import ALL, MAX_PLANT_LABEL, PLANT_COLOURS, PLANTS, PlantEntry, plant_entry
from cranectl.scenario.rig import RigParameters
from cranectl.support.errors import InputError
from cranectl.support.extensions import check_free, check_name, loaded

MODEL_ENDING = ".xml"
OWN_PLANT = "cranectl.plants.mujoco.own_plant:OwnPlant"
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
    if tuple(names) in ALL:
        return tuple(PLANTS)
    return tuple(
        register_model(name) if name.endswith(MODEL_ENDING) else plant_entry(name).name for name in names
    )


def register_model(file: str) -> str:
    """Make the plant of a model file known to this process, and return its name.

    The plant has the name of its file, in lower case letters, digits and hyphens. Raises InputError if there
    is no such file, or if another plant has the name.
    """
    path = Path(file)
    name = re.sub(r"[^a-z0-9]+", "-", path.stem.lower()).strip("-")
    name = name if name[:1].isalpha() else f"model-{name}".rstrip("-")
    if not path.is_file():
        raise InputError(
            f"no model file {file}",
            allowed=f"names of plants, or an MJCF file, whose name ends in {MODEL_ENDING}",
            remedy="check the path",
        )
    check_name("plant", name)
    check_free("plant", name, PLANTS)
    used = [entry.colour for entry in PLANTS.values()]
    PLANTS[name] = PlantEntry(
        name,
        path.name[-MAX_PLANT_LABEL:],
        next((colour for colour in PLANT_COLOURS if colour not in used), PLANT_COLOURS[-1]),
        OWN_PLANT,
        batch=0,
        drives=("velocity", "force"),
        servos=True,
        lacks=dict.fromkeys(LACKED, "whose model file says what it has"),
        by_default=False,
        arguments={"file": str(path.resolve()), "name": name},
    )
    return name


def examine(name: str, rig: RigParameters) -> None:
    """Complete the entry of a plant from a model file by what its model has; leave other entries.

    The rig gives the names of sites and actuators. Raises InputError if the model is not a crane.
    """
    entry = plant_entry(name)
    if entry.where == OWN_PLANT:
        PLANTS[name] = loaded("cranectl.plants.mujoco.own_plant:examined")(entry, rig.plant.names)


def model_plants() -> dict[str, PlantEntry]:
    """Return the plants from model files that this process knows."""
    return {name: entry for name, entry in PLANTS.items() if entry.where == OWN_PLANT}


def forget_models() -> None:
    """Remove the plants from model files."""
    for name in model_plants():
        del PLANTS[name]
