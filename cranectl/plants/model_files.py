"""Plants from model files: a command that names `mine.xml` among its plants runs that model as `mine`."""

import re
from pathlib import Path

from cranectl.plants.entry import MAX_PLANT_LABEL, OWN_PLANT, PLANT_COLOURS, PlantEntry
from cranectl.plants.registry import PLANTS
from cranectl.support import InputError

LACKED = (
    "rope",
    "body",
    "frame",
    "force",
    "friction.pivot_coulomb",
    "friction.pivot_viscous",
    "installation.tilt",
)


def entry_of_file(file: str) -> PlantEntry:
    """Return the plant of a model file, which this process knows from now on.

    It has the name of its file, in lower case letters, digits and hyphens. Raises InputError if there is no
    such file, or if another plant has the name.
    """
    path = Path(file)
    name = re.sub(r"[^a-z0-9]+", "-", path.stem.lower()).strip("-")
    name = name if name[:1].isalpha() else f"model-{name}".rstrip("-")
    if not path.is_file():
        raise InputError(
            f"no model file {path}",
            allowed=f"names of plants, or an MJCF file, whose name ends in {PLANTS.MODEL_ENDING}",
            remedy="check the path",
        )
    arguments = {"file": str(path.resolve()), "name": name}
    if name in PLANTS.model_files and PLANTS[name].arguments["file"] == arguments["file"]:
        return PLANTS[name]
    InputError.check_name("plant", name, taken=PLANTS)
    used = [entry.colour for entry in PLANTS.values()]
    PLANTS[name] = entry = PlantEntry(
        name,
        path.name[-MAX_PLANT_LABEL:],
        next((colour for colour in PLANT_COLOURS if colour not in used), PLANT_COLOURS[-1]),
        OWN_PLANT,
        batch=PLANTS[PLANTS.REFERENCE].batch,
        drives=("velocity", "force"),
        servos=True,
        lacks=dict.fromkeys(LACKED, "whose model file says what it has"),
        by_default=False,
        arguments=arguments,
    )
    return entry
