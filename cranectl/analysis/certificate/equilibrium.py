"""Where the crane with its effects rests at an operating point: Newton on the engine's own forces.

Given are the measured rope length and its rate, and that the drives rest; sought are what else can move, the
angles, the stretch of the rope, the body under its hook, the frame, and the command that holds it, which
makes up for the sag of the servos. A coordinate on which no force depends, the turn of the load about
its own rope, stays as it is.
"""

import numpy as np

from cranectl.analysis.certificate.operating_points import (
    LARGEST_SINE,
    HeldState,
    OperatingPoint,
    held_state,
    signals_at,
)
from cranectl.analysis.certificate.systems import Array, differences
from cranectl.errors import InputError
from cranectl.plants.interface import Drive
from cranectl.plants.mujoco import MujocoPlant
from cranectl.plants.mujoco_effects.tangent import (
    Anchor,
    anchor_of,
    free_coordinates,
    load_velocity,
    moved,
    stretch,
    unbalanced,
)

STEP = 1e-5  # of the differences, in each signal's unit
OF_STRETCH = 0.1  # and at most this part of the rope's stretch, so that it stays taut
ENOUGH = 1e-9  # of the load's weight [N, N m]
SINGULAR = 1e-10  # of the largest singular value, below which a coordinate has no effect
ITERATIONS = 30


def equilibrium(
    plant: MujocoPlant, point: OperatingPoint, drive: Drive, air: Array, gravity: float
) -> tuple[Anchor, Array, HeldState]:
    """The engine's state, the command (3,) that holds it, and the signals there.

    Raises InputError where no such state is found.
    """
    start, free = _starting_guess(plant, point, gravity), free_coordinates(plant)
    commands = 0 if drive == "ideal" else 3  # ideal drives rest by themselves

    def split(unknown: Array) -> tuple[Anchor, Array]:
        turn, command = np.zeros(plant.model.nv), np.zeros(3)
        turn[free], command[:commands] = unknown[commands:], unknown[:commands]
        return moved(plant, start, turn), command

    def residual(unknown: Array) -> Array:
        force = unbalanced(plant, *split(unknown), np.array(point.tilt), air)
        return force if commands else force[free]

    unknown, enough = np.zeros(commands + len(free)), ENOUGH * plant.rig.load_mass * gravity
    for _ in range(ITERATIONS):
        left = residual(unknown)
        if np.abs(left).max() < enough:
            break
        steps = np.full(len(unknown), step_at(plant, split(unknown)[0]))
        unknown -= np.linalg.lstsq(differences(residual, unknown, steps), left, rcond=SINGULAR)[0]
    found, command = split(unknown)
    joints = np.zeros(10)
    joints[0::2], joints[1::2] = found.qpos[plant.rig.joints], found.qvel[plant.rig.rates]
    if not np.abs(left).max() < enough or np.abs(joints[[6, 8]]).max() > np.arcsin(LARGEST_SINE):
        raise InputError(
            f"no rest to be found at {point} with the scenario's effects",
            allowed="operating points at which the load can be held",
            remedy="choose a smaller tilt, or weaker effects",
        )
    return found._replace(load_velocity=load_velocity(plant)), command, signals_at(joints, gravity)


def _starting_guess(plant: MujocoPlant, point: OperatingPoint, gravity: float) -> Anchor:
    """The state of a crane without effects, its rope stretched as it hangs still, and only then running."""
    joints = held_state(point, gravity).joints.copy()
    joints[5] = 0.0
    plant.reset(joints)
    start = anchor_of(plant)
    start.qvel[[plant.rig.rates[2], plant.rig.distance[1]]] = point.hoisting_speed
    return start


def step_at(plant: MujocoPlant, anchor: Anchor) -> float:
    """Step of the differences about `anchor`."""
    return min(STEP, OF_STRETCH * max(stretch(plant, anchor), 1e-9))
