"""Model files for tests: foreign cranes, the shipped model with changes, and rigs that fit them."""

import re
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from cranectl import open_run
from cranectl.scenario import Scenario
from cranectl.scenario.rig import ModelNames
from cranectl.support import Array
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


MOVED_FOR = 1000  # samples of `beside_bare_mujoco`
SPEED = np.array([0.3, 0.2, 0.1])  # [m/s] of a motion's set-points


def swept(k: int) -> Array:
    """Return velocities (3,) of bridge, trolley and rope at sample `k` [m/s]."""
    return SPEED * np.sin(0.01 * k)


def at_rest(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Begin with filters and controls at zero: velocity drives that hold the weight by their bias."""


def beside_bare_mujoco(
    file: Path,
    scenario: Scenario,
    drive: str,
    *,
    begin: Callable[[mujoco.MjModel, mujoco.MjData], None] = at_rest,
    scale: float | Array = 1.0,
    integrates: bool = False,
    command: Callable[[int], Array] = swept,
) -> tuple[Array, Array]:
    """Move a model in an open run, and bare MuJoCo by the same commands.

    Parameters
    ----------
    begin : Callable
        Sets the controls at the start, in a pose of which `scenario` has the place.
    scale : float or Array
        The controls over the commands, shape (n,).
    integrates : bool
        Whether the controls are set-points of positions.

    Returns
    -------
    states : Array
        What the run shows, shape (MOVED_FOR, 10).
    points : Array
        Pivot and load of bare MuJoCo as `points_of` has them, shape (MOVED_FOR, 5) [m].
    """
    names = scenario.rig.model_names
    crane = open_run(scenario, plant=str(file), drive=drive)
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, scenario.control.physics_step
    data, states, points = mujoco.MjData(model), [], []
    if names.keyframe:
        mujoco.mj_resetDataKeyframe(model, data, model.key(names.keyframe).id)
    begin(model, data)
    drives = [model.actuator(name).id for name in names.drives if name]
    moves = np.array([bool(name) for name in names.drives])
    for k in range(MOVED_FOR):
        crane.step(command(k))
        control = scale * command(k)[moves]
        for _ in range(round(scenario.control.period / model.opt.timestep)):
            if integrates:
                data.ctrl[drives] += 0.5 * model.opt.timestep * control  # to the middle of the step
            else:
                data.ctrl[drives] = control
            mujoco.mj_step(model, data)
            if integrates:
                data.ctrl[drives] += 0.5 * model.opt.timestep * control
        mujoco.mj_kinematics(model, data)
        pivot, load = _point(data, names.pivot, "xpos"), _point(data, names.load, "xipos")
        points.append(np.concatenate([pivot[:2], load - pivot]))
        states.append(crane.state)
    return np.array(states), np.array(points)


def points_of(states: Array) -> Array:
    """Return x and y of the pivot, and where the load is from there, shape (n, 5) [m]; states are (n, 10)."""
    length, alpha, beta = states[:, 4], states[:, 6], states[:, 8]
    below = np.cos(beta) * np.sin(alpha), -np.cos(beta) * np.cos(alpha)
    return np.column_stack([states[:, 0], states[:, 2], *(length * way for way in (np.sin(beta), *below))])


def _point(data: mujoco.MjData, name: str, of_body: str) -> Array:
    """Return the place of a site, or of the body that stands for it [m]."""
    try:
        return np.array(data.site(name).xpos)
    except KeyError:
        return np.array(getattr(data.body(name), of_body))
