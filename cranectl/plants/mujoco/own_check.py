"""Check how a model file differs from the rigid crane that the other plants share.

The check uses no equations of motion. A point on which only gravity and a rope act, and three masses on which
only their drives and the rope act, must explain the engine's accelerations in random states. So springs,
friction, an inertia of the load, a second pendulum and errors of the engine show, each with its size.
"""

import copy
import functools
from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_causes import causes_of
from cranectl.plants.mujoco.own_model import WINCH, OwnModel
from cranectl.plants.mujoco.own_ranges import are_limited
from cranectl.plants.mujoco.sites import AXES, rope_acceleration
from cranectl.signals import ROPE
from cranectl.support import Array

TRIED_STATES = 200  # random ones
# Half the ranges of random states: positions in lengths of the rope, angles [rad], and rates over those of a
# free swing.
POSITIONS, ANGLES, SPEEDS = 0.2, 0.3, 0.3
EXPLAINED = 1e-6  # [m/s²] of accelerations that agree, a ten-millionth of gravity


class ModelDifference(NamedTuple):
    """A difference between a model and the rigid crane."""

    what: str
    size: float  # [m/s²]; 0 for drives of another kind
    meaning: str
    line: str = ""  # to be written into the file, if one is known

    @property
    def text(self) -> str:
        """What differs and by how much."""
        return f"{self.what} {self.size:.2g} m/s²" if self.size else self.what


@functools.lru_cache(maxsize=8)
def find_differences(own: OwnModel) -> tuple[ModelDifference, ...]:
    """Return how a model differs from the rigid crane; empty if it does not."""
    unrest = np.max([_unrest(own, state) for state in own.places()], axis=0)
    unseen = ANGLES * np.random.default_rng(1).uniform(-1.0, 1.0, (TRIED_STATES, 2, own.model.nv))
    excess = np.max([_excess(own, *pair) for pair in zip(_random_states(own), unseen, strict=True)], axis=0)
    known = [cause.text for cause in causes_of(own)]
    causes = ", ".join([*known, "or further masses or forces"]) if known else "further masses or forces"
    rest, line = f"it accelerates while its drives rest: {causes}", ""
    if bias := _holding_bias(own):
        gain = own.model.actuator_gainprm[own.drives[-1], 0]
        general = f'<general gainprm="{gain:g}" biastype="affine" biasprm="{bias}"/>'
        line = f"as {general} the winch holds the weight"
    driven = [AXES[axis] for axis in own.axes]
    meanings = [f"drive and rope do not explain how the {axis} accelerates: {causes}" for axis in driven]
    meanings.append(f"the load does not swing as a point on a massless rope: {causes}")
    sized = [
        *((f"{axis} at rest", size, rest) for axis, size in zip(AXES, unrest, strict=True)),
        *zip((*driven, "swing"), excess, meanings, strict=True),
    ]
    differences = [
        ModelDifference(what, float(size), why, line if what == f"{AXES[WINCH]} at rest" else "")
        for what, size, why in sized
        if not size <= EXPLAINED
    ]
    if own.servo not in ("velocity", "force"):
        differences.append(ModelDifference("position servos", 0.0, "drives of other plants take velocities"))
    for name, seconds in zip(own.drive_names, own.filters, strict=True):
        if seconds:
            differences.append(
                ModelDifference(
                    f"filter of {seconds:g} s before {name}",
                    0.0,
                    "drives of other plants have one lag, the sum of this filter and of the servo"
                    if own.servo != "force"
                    else "force drives of other plants have no lag",
                )
            )
    if (limited := are_limited(own)).any():
        names = " and ".join(name for name, has in zip(own.drive_names, limited, strict=True) if has)
        meaning = f"of control or force of {names}; drives of other plants have none"
        differences.append(ModelDifference("limits of drives", 0.0, meaning))
    return (*differences, *_stops(own))


def _holding_bias(own: OwnModel) -> str:
    """Return the bias with which a velocity drive of the winch would hold the weight; empty if none does."""
    if own.servo != "velocity" or not own.has_winch:
        return ""
    model = copy.copy(own.free)
    bias = model.actuator_biasprm[own.drives[-1]]
    bias[0] = -own.load_mass * own.gravity / own.ratios[-1]
    if max(_unrest(own, state, model)[WINCH] for state in own.places()) > EXPLAINED:
        return ""
    return " ".join(f"{number:g}" for number in bias[:3] + 0.0)


def _stops(own: OwnModel) -> Iterator[ModelDifference]:
    """Yield end stops within the swing of the random states, and contacts of the hanging crane."""
    model = own.model
    turning = model.jnt_type <= int(mujoco.mjtJoint.mjJNT_BALL)
    turning |= model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)
    met = set[int]()
    for state in _random_states(own) if (turning & (model.jnt_limited > 0)).any() else ():
        data = own.new_data()
        own.place(data, state)
        mujoco.mj_fwdPosition(model, data)
        met |= {*data.efc_id[data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT)].tolist()}
    for joint in sorted(met & {*np.flatnonzero(turning).tolist()}):
        ends = ", ".join(f"{end:.3g}" for end in model.jnt_range[joint])
        yield ModelDifference(
            f"end stop of {model.joint(joint).name or joint}",
            0.0,
            f"its range [{ends}] rad ends within {ANGLES:g} rad of swing; loads of other plants swing freely",
        )
    data = own.new_data()
    own.place(data, own.rest)
    mujoco.mj_fwdPosition(model, data)
    for pair in sorted({tuple(geoms) for geoms in data.contact.geom.tolist()}):
        shapes = [model.geom(geom).name or f"a shape of {_body(model, geom)}" for geom in pair]
        meaning = "they touch while the load hangs; other plants touch nothing"
        yield ModelDifference(f"contact of {' and '.join(shapes)}", 0.0, meaning)


def _body(model: mujoco.MjModel, geom: int) -> str:
    body = int(model.geom_bodyid[geom])
    return str(model.body(body).name or f"body {body}")


def _random_states(own: OwnModel) -> Iterator[Array]:
    """Yield random states (10,) about that of the file."""
    rng, length = np.random.default_rng(0), own.rest[ROPE]
    speed = SPEEDS * np.sqrt(own.gravity * length)
    along, swing = (POSITIONS * length, speed), (ANGLES, speed / length)
    moves = np.isin([0, 1, 2, 1, 0], own.axes)  # of the swings, alpha is along y and beta along x
    spread = np.array([*along, *along, *along, *swing, *swing]) * moves.repeat(2)
    for _ in range(TRIED_STATES):
        yield own.rest + spread * rng.uniform(-1.0, 1.0, 10)


def _unrest(own: OwnModel, state: Array, model: mujoco.MjModel | None = None) -> Array:
    """Return the accelerations (5,) that the sites show while all drives hold [m/s²]."""
    data, gradient = _forward(own, state, model)
    lengths = np.array([1.0, 1.0, 1.0, state[ROPE], state[ROPE]])
    return np.asarray(np.abs(gradient @ data.qacc) * lengths)


def _forward(
    own: OwnModel, state: Array, model: mujoco.MjModel | None = None, *, unseen: Array | None = None
) -> tuple[mujoco.MjData, Array]:
    """Return the engine's data in a state whose drives hold, and the gradient (5, nv) there.

    What the two sites do not show moves by `unseen` (2, nv), such as a pendulum beside the load.
    """
    model = model or own.free
    data = own.new_data(model)
    gradient = own.place(data, state)
    if unseen is not None:
        mujoco.mj_integratePos(model, data.qpos, _unshown(gradient) @ unseen[0], 1.0)
        gradient = own.place(data, state)
        data.qvel[:] += _unshown(gradient) @ unseen[1]
    own.hold(data)
    mujoco.mj_forward(model, data)
    return data, gradient


def _unshown(gradient: Array) -> Array:
    """Return the projector (nv, nv) on motions that the sites do not show."""
    return np.asarray(np.eye(gradient.shape[1]) - np.linalg.pinv(gradient) @ gradient)


def _excess(own: OwnModel, state: Array, unseen: Array) -> Array:
    """Return the accelerations (n + 1,) of driven axes and swing that nothing explains [m/s²]."""
    data, _ = _forward(own, state, unseen=unseen)
    # The engine adds gravity to accelerations: they are forces over mass.
    load, pivot, pivot_force, force = (data.sensordata[own.sensors[k : k + 3]] for k in (0, 7, 13, 16))
    direction = (load - pivot) / np.linalg.norm(load - pivot)
    tension = -own.load_mass * (direction @ force)
    axes = own.axes
    masses = own.driven_masses - np.where(axes == WINCH, own.load_mass, 0.0)
    pulls = own.ratios * data.actuator_force[own.drives] + tension * np.array([*direction[:2], 1.0])[axes]
    accelerations = np.array([*pivot_force[:2], rope_acceleration(own.sensors, data.sensordata)])[axes]
    swing = np.linalg.norm(force - direction * (direction @ force))
    return np.array([*np.abs(accelerations * masses - pulls) / own.driven_masses, swing])
