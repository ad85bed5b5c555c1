"""The crane as it is built: servos, a rope that gives, a load with a body, a frame that gives, air.

Its equations (`crane_equations`) are its own, nothing of the engine is in them: a budget made with them
predicts the engine's levels without running one. Coordinates, ten of them, each with its rate (20 states):

    x_c, y_c, l      bridge, trolley (from the rails) and length, as the encoders count them
    alpha, beta      direction n of the rope
    e                stretch of the rope: from pivot to hook r = l - offset + e
    alpha_b, beta_b  direction b from hook to centre of mass, as of a second rope
    q_x, q_y         rails in the world

The load is at (x_c + q_x, y_c + q_y, 0) + r n + offset b. What an effect does not add stands still.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.crane_equations import ALPHA_B, BETA_B, COORDINATES, Q_X, STATES, STRETCH
from cranectl.plants.surroundings import air_drag
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.scenario.effects import EffectSettings
from cranectl.signals import ROPE

Array = NDArray[np.float64]


class RealCrane(NamedTuple):
    """Constants in SI units; a frame, rope or body that is not there is marked by `moves`."""

    moves: NDArray[np.bool_]  # (10,) coordinates that do
    gravity: float
    load_mass: float
    bridge_mass: float
    trolley_mass: float
    winch_mass: float
    gain: Array  # (3,) of the velocity drives [N s/m]
    held: float  # weight that the winch's drive holds [N]
    offset: float  # hook above the centre of mass [m]
    inertia: float  # of the body [kg m²]
    swing_damping: float  # [N m s/rad]
    stiffness: float  # E A [N]
    viscosity: float  # times length [N s]
    density: float  # of the rope [kg/m]
    frame_mass: float
    frame_stiffness: Array  # (2,) [N/m]
    frame_damping: Array  # (2,) [N s/m]
    drag: float  # [kg/m]
    substeps: int
    step: float  # [s]


def make_crane(scenario: Scenario, effects: EffectSettings, start_length: float) -> RealCrane:
    """The rig of `scenario` with velocity drives and rope, body, wind and frame as in `effects`.

    `start_length` [m]: measured, to which the rope's damping ratio refers.
    """
    rig, rope, body, frame = scenario.rig, effects.rope, effects.body, effects.frame
    offset = body.hook_offset if body else 0.0
    moves = np.ones(COORDINATES, dtype=np.bool_)
    moves[STRETCH], moves[ALPHA_B : BETA_B + 1], moves[Q_X:] = bool(rope), bool(body), bool(frame)
    viscosity = 0.0
    if rope:
        hanging = start_length - offset
        viscosity = 2.0 * rope.damping_ratio * sqrt(rope.stiffness * rig.load_mass * hanging)
    standing = rig.bridge_mass + rig.trolley_mass + (frame.mass if frame else 0.0)
    omega = 2.0 * np.pi * np.array(frame.frequency if frame else (0.0, 0.0))
    return RealCrane(
        moves=moves,
        gravity=rig.gravity,
        load_mass=rig.load_mass,
        bridge_mass=rig.bridge_mass,
        trolley_mass=rig.trolley_mass,
        winch_mass=rig.winch_mass,
        gain=rig.velocity_gains,
        held=rig.weight,
        offset=offset,
        inertia=body.inertia if body else 0.0,
        swing_damping=body.swing_damping if body else 0.0,
        stiffness=rope.stiffness if rope else 0.0,
        viscosity=viscosity,
        density=rope.mass if rope else 0.0,
        frame_mass=frame.mass if frame else 0.0,
        frame_stiffness=standing * omega**2,
        frame_damping=2.0 * (frame.damping_ratio if frame else 0.0) * standing * omega,
        drag=air_drag(effects),
        substeps=scenario.substeps,
        step=scenario.period_ns / NANOSECONDS / scenario.substeps,
    )


def nominal_states(crane: RealCrane, joints: Array, tension: Array) -> Array:
    """(N, 20): joints (N, 10) of a run, the rope stretched by its tension (N,) [N], the rest at rest."""
    states = np.zeros((len(joints), STATES))
    states[:, :10] = joints
    if crane.moves[STRETCH]:
        states[:, 2 * STRETCH] = tension * (joints[:, ROPE] - crane.offset) / crane.stiffness
    if crane.moves[ALPHA_B]:
        states[:, 2 * ALPHA_B : 2 * BETA_B + 2] = joints[:, 6:10]
    return states


def kept_states(crane: RealCrane) -> NDArray[np.intp]:
    """Indices of the states that move."""
    return np.flatnonzero(np.repeat(crane.moves, 2))


def load_positions(crane: RealCrane, states: Array) -> Array:
    """Of states (N, 20): load in the world (N, 3) [m]."""
    x, y, length, alpha, beta, stretch, alpha_b, beta_b, q_x, q_y = states[:, ::2].T
    rope, body = _directions(alpha, beta), _directions(alpha_b, beta_b)
    reach = length - crane.offset + stretch
    pivot = np.column_stack([x + q_x, y + q_y, np.zeros(len(x))])
    positions: Array = pivot + reach[:, None] * rope + crane.offset * body
    return positions


def _directions(alpha: Array, beta: Array) -> Array:
    return np.column_stack([np.sin(beta), np.cos(beta) * np.sin(alpha), -np.cos(alpha) * np.cos(beta)])
