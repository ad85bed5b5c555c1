"""Constants, state vector and initial state of the elastic crane.

The state (22) begins with the joints, in the order of `SignalGroup.STATE`. Then it has

    e, e'   stretch of the rope and its rate; the distance from pivot to hook is r = l - offset + e
    b, w    unit vector from hook to the load's centre of mass, and its angular velocity [rad/s], (x, y, z)
    q_x, q_x', q_y, q_y'   positions and velocities of the rails in the world

With n the direction of the rope, the load is at (x_c + q_x, y_c + q_y, 0) + r n + offset b.
"""

from math import inf, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.plants.plant import DRIVES, Drive, Triple
from cranectl.plants.surroundings import air_drag, gravity_in_rig
from cranectl.scenario import EffectSettings, Frame, RigParameters
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY
from cranectl.support import Array

STRETCH, STRETCH_RATE, BODY, SPIN, RAILS, STATES = 10, 11, 12, 15, 18, 22
JOINTS = 5  # bridge, trolley, winch, alpha, beta; joint i has its position at 2 i and its rate at 2 i + 1
# The method of Dormand and Prince of order 5: Hairer, Nørsett, Wanner: Solving Ordinary Differential
# Equations I, 2nd ed., table II.5.2. Written out, because importing SciPy's takes half a second.
A = np.array([
    [0, 0, 0, 0, 0],
    [1 / 5, 0, 0, 0, 0],
    [3 / 40, 9 / 40, 0, 0, 0],
    [44 / 45, -56 / 15, 32 / 9, 0, 0],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
])  # fmt: skip
B = np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84])
STAGES = len(A)
MIN_ROPE = 1e-3  # [m] of rope for its stiffness, which would be infinite for a rope that is wound in


class ElasticCrane(NamedTuple):
    """Constants of the elastic crane, in SI units.

    The drives push with gain · command - damping · rate - holding force, within `limit`.
    """

    prescribed: bool  # whether the drives are ideal, which accelerate as commanded
    fixed: tuple[bool, bool, bool]  # whether bridge, trolley, winch are fixed
    gain: Triple
    damping: Triple  # of drives [N s/m]
    holding_force: Triple  # [N]
    limit: Triple  # [N]
    axis_mass: Triple  # bridge with trolley, trolley, winch [kg]
    motor_mass: tuple[float, float]  # moving with the axis relative to its rails alone [kg]
    gravity: Triple  # [m/s²]
    load_mass: float
    has_friction: bool  # whether any joint has Coulomb friction
    coulomb: tuple[float, float, float, float, float]  # of the joints [N, N m]
    viscous: tuple[float, float, float, float, float]  # [N s/m, N m s/rad]
    has_body: bool  # whether the load is a body under its hook
    offset: float  # hook above the centre of mass [m]
    inertia: float  # about any axis through it [kg m²]
    swing_damping: float  # between hook and body [N m s/rad]
    hook_mass: float  # at the rope's end [kg]
    has_elastic_rope: bool
    stiffness: float  # E A [N]
    viscosity: Array  # (1,) damping times length [N s], set at the start by the damping ratio
    density: float  # of the rope [kg/m]
    has_frame: bool  # whether the frame is elastic
    rail_mass: tuple[float, float]  # moving with the rails along x and y, without what runs on them [kg]
    rail_weight: tuple[float, float]  # of that mass along slopes [N]
    rail_stiffness: tuple[float, float]  # [N/m]
    rail_damping: tuple[float, float]  # [N s/m]
    in_air: bool  # whether the effect `wind` is on
    drag: float  # force over the square of the load's speed through the air [kg/m]
    changing: NDArray[np.int64]  # indices of the states that can change
    substeps: int
    step: float  # [s]


def make_crane(
    rig: RigParameters, effects: EffectSettings, drive: Drive, *, step: float, substeps: int
) -> ElasticCrane:
    """Return the constants of `rig` with `effects`."""
    rope, body, frame, friction = effects.rope, effects.body, effects.frame, effects.friction
    gravity, none = gravity_in_rig(rig.gravity, effects), (0.0, 0.0, 0.0)
    fixed = (not rig.moves[0], not rig.moves[1], not rig.moves[2])
    ideal, (gain, damping, load_force) = DRIVES[drive].is_prescribed, DRIVES[drive].push(rig, effects)
    coulomb, viscous = (friction.coulomb, friction.viscous) if friction and not ideal else (none, none)
    along_x, along_y, along_rope = (0.0 if still else c for still, c in zip(fixed, coulomb, strict=True))
    pivot = (friction.pivot_coulomb, friction.pivot_viscous) if friction else (0.0, 0.0)
    parts = ((0, STRETCH, True), (STRETCH, BODY, rope), (BODY, RAILS, body), (RAILS, STATES, frame))
    return ElasticCrane(
        prescribed=ideal,
        fixed=fixed,
        gain=gain,
        damping=damping,
        holding_force=load_force,
        limit=effects.limits.force if effects.limits else (inf, inf, inf),
        axis_mass=(rig.bridge_mass + rig.trolley_mass, rig.trolley_mass, rig.winch_mass),
        motor_mass=(0.0, rig.trolley_motor_mass),
        gravity=gravity,
        load_mass=rig.load_mass,
        has_friction=any((along_x, along_y, along_rope, pivot[0])),
        coulomb=(along_x, along_y, along_rope, pivot[0], pivot[0]),
        viscous=(*viscous, pivot[1], pivot[1]),
        has_body=body is not None,
        offset=body.hook_offset if body else 0.0,
        inertia=body.inertia if body else 1.0,
        swing_damping=body.swing_damping if body else 0.0,
        hook_mass=body.hook_mass if body else 0.0,
        has_elastic_rope=rope is not None,
        stiffness=rope.stiffness if rope else 0.0,
        viscosity=np.zeros(1),
        density=rope.mass if rope else 0.0,
        has_frame=frame is not None,
        **_rails(rig, frame, gravity),
        in_air=effects.wind is not None,
        drag=air_drag(effects),
        changing=np.concatenate([np.arange(first, end) for first, end, part in parts if part]),
        substeps=substeps,
        step=step,
    )


def _rails(rig: RigParameters, frame: Frame | None, gravity: Triple) -> dict[str, tuple[float, float]]:
    """Return mass, weight, stiffness and damping of the rails, for the frequencies of an empty rig."""
    if frame is None:
        return dict.fromkeys(("rail_mass", "rail_weight", "rail_stiffness", "rail_damping"), (0.0, 0.0))
    vibrating = frame.mass + rig.bridge_mass + rig.trolley_mass
    along_x, along_y = (2.0 * pi * frequency for frequency in frame.frequency)
    damping = 2.0 * frame.damping_ratio * vibrating
    return {
        # Along y the rails carry the bridge too. The frame's own mass has no weight along slopes.
        "rail_mass": (frame.mass, frame.mass + rig.bridge_mass),
        "rail_weight": (0.0, rig.bridge_mass * gravity[1]),
        "rail_stiffness": (vibrating * along_x**2, vibrating * along_y**2),
        "rail_damping": (damping * along_x, damping * along_y),
    }


def set_damping(crane: ElasticCrane, effects: EffectSettings, length: float) -> None:
    """Set the rope's viscosity so that the load has its damping ratio at the initial `length` [m]."""
    if effects.rope:
        hanging = max(length - crane.offset, MIN_ROPE)
        critical = 2.0 * sqrt(crane.stiffness * (crane.load_mass + crane.hook_mass) * hanging)
        crane.viscosity[0] = effects.rope.damping_ratio * critical


def hanging_states(crane: ElasticCrane, joints: Array, tension: Array) -> Array:
    """Return states (N, 22) at `joints` (N, 10), with the rope stretched by `tension` (N,) [N].

    The body turns with the hook, also about the rope. The rails are at rest.
    """
    states = np.zeros((len(joints), STATES))
    states[:, : 2 * JOINTS] = joints
    if crane.has_elastic_rope:
        paid_out = np.maximum(joints[:, ROPE] - crane.offset, MIN_ROPE)
        states[:, STRETCH] = tension * paid_out / crane.stiffness
    if crane.has_body:
        states[:, BODY : BODY + 3] = directions(joints)
        # Alpha turns about x, beta about the axis (0, -cos alpha, -sin alpha).
        alpha, beta_rate = joints[:, ALPHA], joints[:, BETA + 1]
        states[:, SPIN] = joints[:, ALPHA + 1]
        states[:, SPIN + 1], states[:, SPIN + 2] = -beta_rate * np.cos(alpha), -beta_rate * np.sin(alpha)
    return states


def directions(states: Array) -> Array:
    """Return the unit vectors n along the rope, (N, 3), of `states` (N, 10 or 22)."""
    alpha, beta = states[:, ALPHA], states[:, BETA]
    return np.column_stack([np.sin(beta), np.cos(beta) * np.sin(alpha), -np.cos(alpha) * np.cos(beta)])


def load_positions(crane: ElasticCrane, states: Array) -> Array:
    """Return the position of the load in the world, (N, 3) [m], of `states` (N, 22)."""
    positions: Array = (states[:, ROPE] - crane.offset + states[:, STRETCH])[:, None] * directions(states)
    positions += crane.offset * states[:, BODY : BODY + 3]
    positions[:, 0] += states[:, BRIDGE] + states[:, RAILS]
    positions[:, 1] += states[:, TROLLEY] + states[:, RAILS + 2]
    return positions


class Work(NamedTuple):
    """Work space of a step, and results besides the rates. Only the lower half of matrices is used."""

    matrix: Array  # (5, 5) masses of load and rope
    factor: Array  # (5, 5)
    force: Array  # (5,) on load and rope
    acceleration: Array  # (5,) of the coordinates
    along: Array  # (5,) hook velocity along b for a unit rate of each coordinate
    push: Array  # (3,) of drives and friction on the axes [N]
    sign: Array  # (5,) sign of the rate of a sliding joint; 0 for others
    stuck: NDArray[np.bool_]  # (5,) whether friction holds the joint
    fixed: NDArray[np.bool_]  # (5,) whether the acceleration of the coordinate is prescribed
    holding: Array  # (5,) friction force that holds a stuck joint [N, N m]
    margins: Array  # (5,) `margin` of each joint at the start of a part of the step
    tension: Array  # (1,) [N]
    velocity: Array  # (3,) of the load [m/s]
    rates: Array  # (STAGES + 1, 22)
    trial: Array  # (22,)
    end: Array  # (22,)


def make_work() -> Work:
    """Return new work space, for joints that slide without friction."""
    five, state = (JOINTS,), (STATES,)
    return Work(
        matrix=np.zeros((JOINTS, JOINTS)),
        factor=np.zeros((JOINTS, JOINTS)),
        force=np.zeros(five),
        acceleration=np.zeros(five),
        along=np.zeros(five),
        push=np.zeros(3),
        sign=np.zeros(five),
        stuck=np.zeros(five, dtype=np.bool_),
        fixed=np.zeros(five, dtype=np.bool_),
        holding=np.zeros(five),
        margins=np.zeros(five),
        tension=np.zeros(1),
        velocity=np.zeros(3),
        rates=np.zeros((STAGES + 1, STATES)),
        trial=np.zeros(state),
        end=np.zeros(state),
    )
