"""Model files for tests: foreign cranes, the shipped model with changes, and rigs that fit them."""

import re
from pathlib import Path

from cranectl.scenario.rig import ModelNames
from cranectl.support.resources import Shipped

MODELS = Path(__file__).parent / "models"
HALL_NAMES = ModelNames(pivot="sheave", load="hook", bridge_drive="LT", trolley_drive="CT", winch_drive="H")
NAMES = {"hall": HALL_NAMES}
# A rig file of the crane in `models/hall.xml`, and a motion of it.
HALL_RIG = """\
bridge_range = [0.0, 30.0]
trolley_range = [0.0, 12.0]
rope_range = [1.0, 8.0]
bridge_mass = 6000.0
trolley_mass = 1500.0
winch_mass = 400.0
load_mass = 5000.0
rated_load = 5000.0
bridge_time_constant = 0.25
trolley_time_constant = 0.25
winch_time_constant = 0.15

[plant.names]
pivot = "sheave"
load = "hook"
bridge_drive = "LT"
trolley_drive = "CT"
winch_drive = "H"
"""
HALL = """\
name = "hall"
rig = "rigs/hall.toml"
duration = 12.0
reference.start = [5.0, 3.0, -4.0]
reference.segments = [{ kind = "line", to = [9.0, 5.0, -5.0], duration = 10.0 }]

[[disturbances]]
joint = "alpha"
start = 3.0
magnitude = 0.01
"""
UNDISTURBED = "disturbances=[]"
# Numbers of the rig that a model has instead of the laboratory's.
RIGS = {"tendon": ["rig.winch_mass=1e-5"]}


def write_hall(folder: Path, *, model: str = "") -> Path:
    """Write the hall's rig into `rigs/`, with a `model` if one is given, and return its motion's."""
    (folder / "rigs").mkdir()
    (folder / "rigs" / "hall.toml").write_text((f'model = "{model}"\n' if model else "") + HALL_RIG)
    (folder / "hall.toml").write_text(HALL)
    return folder / "hall.toml"


def changed(model: Path, folder: Path, *changes: tuple[str, str], name: str = "mine") -> Path:
    """Write a model with `changes` of its text, each of which must occur."""
    text = model.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = folder / f"{name}.xml"
    file.write_text(text)
    return file


def crane_with(folder: Path, *changes: tuple[str, str], name: str = "mine") -> Path:
    """Write the shipped model with `changes`."""
    return changed(Shipped.MODEL_FILE, folder, *changes, name=name)


def servos(kind: str) -> list[tuple[str, str]]:
    """Return the changes that replace the drives of the shipped model."""
    text = Shipped.MODEL_FILE.read_text()
    joints = {"bridge": "bridge_position", "trolley": "trolley_position", "winch": "rope_length"}
    gains = ' kp="900" kv="90"' if kind == "position" else ""
    return [
        (
            re.findall(rf'<(?:velocity|general) name="{name}_drive"[^>]*>', text)[0],
            f'<{kind} name="{name}_drive" joint="{joint}"{gains}/>',
        )
        for name, joint in joints.items()
    ]
