"""The books of the elastic crane: what drives and wind put in is stored or lost, effect by effect."""

import numpy as np
import pytest

from cranectl.plants.elastic.crane import BODY, RAILS, SPIN, STRETCH, STRETCH_RATE
from cranectl.plants.elastic.plant import ElasticPlant
from cranectl.plants.plant import Drive
from cranectl.scenario.effects import Body, EffectNumbers, EffectSettings, Frame, Friction, Rope, Wind
from cranectl.scenario.rig import RigParameters
from cranectl.support.arrays import Array

RIG = RigParameters()
NUMBERS = EffectNumbers(
    rope=Rope(stiffness=500.0, mass=0.0, damping_ratio=0.02),  # a heavy one would carry mass out of the winch
    body=Body(hook_offset=0.2, inertia=0.03, swing_damping=0.02),
    frame=Frame(frequency=(1.0, 1.5), damping_ratio=0.05),
    friction=Friction(coulomb=(0.0, 0.0, 0.0), pivot_coulomb=0.0, pivot_viscous=0.01),
    wind=Wind(drag_area=0.2),
)
START = np.array([0.0, 0.1, 0.0, -0.2, 0.8, 0.05, 0.3, 0.4, -0.25, -0.3])
WIND = np.array([1.5, -0.9, 0.3, 0.2, -0.1, 0.3])
PERIOD = 1e-3


def load_of(state: Array, offset: float) -> tuple[Array, Array, Array]:
    """Position and velocity of the load, spin of the hook."""
    sa, ca, sb, cb = (f(state[k]) for k in (6, 8) for f in (np.sin, np.cos))
    n = np.array([sb, cb * sa, -ca * cb])
    spin = np.array([state[7], -state[9] * ca, -state[9] * sa])
    r, r_rate = state[4] - offset + state[STRETCH], state[5] + state[STRETCH_RATE]
    pivot = np.array([state[0] + state[RAILS], state[2] + state[RAILS + 2], 0.0])
    speed = np.array([state[1] + state[RAILS + 1], state[3] + state[RAILS + 3], 0.0])
    body = offset * state[BODY : BODY + 3]
    turning = np.cross(state[SPIN : SPIN + 3], body)
    return pivot + r * n + body, speed + r_rate * n + r * np.cross(spin, n) + turning, spin


def books(plant: ElasticPlant, effects: EffectSettings, command: Array, air: Array) -> tuple[float, float]:
    """Energy of the plant's state [J], and what goes in less what is lost [W]."""
    state, rig, rope, body = plant.state, RIG, effects.rope, effects.body
    position, speed, spin = load_of(state, body.hook_offset if body else 0.0)
    axes, rails = state[1:6:2], state[RAILS + 1 :: 2]
    moving = np.array([axes[0] + rails[0], rails[1]]), np.array([axes[0] + rails[0], axes[1] + rails[1]])
    energy = 0.5 * rig.bridge_mass * moving[0] @ moving[0] + 0.5 * rig.trolley_mass * moving[1] @ moving[1]
    energy += 0.5 * rig.winch_mass * axes[2] ** 2 + rig.load_mass * (
        0.5 * speed @ speed + rig.gravity * position[2]
    )
    given = (
        command if plant.drive == "force" else rig.velocity_gains * (command - axes) - [0.0, 0.0, rig.weight]
    )
    power = given @ axes + air[3:] @ speed
    if effects.wind:
        through = air[:3] - speed
        drag = 0.5 * effects.wind.density * effects.wind.drag_area * np.linalg.norm(through)
        power += drag * through @ speed
    if friction := effects.friction:
        power -= np.array(friction.viscous) @ axes**2 + friction.pivot_viscous * (
            state[7] ** 2 + state[9] ** 2
        )
    if frame := effects.frame:
        standing = rig.bridge_mass + rig.trolley_mass + frame.mass
        rate = 2.0 * np.pi * np.array(frame.frequency)
        energy += 0.5 * frame.mass * rails @ rails + 0.5 * standing * rate**2 @ state[RAILS::2] ** 2
        power -= 2.0 * frame.damping_ratio * standing * rate @ rails**2
    if body:
        energy += 0.5 * body.inertia * state[SPIN : SPIN + 3] @ state[SPIN : SPIN + 3]
        slip = spin - state[SPIN : SPIN + 3]
        power -= body.swing_damping * slip @ slip
    if rope:  # what is paid out while it pulls takes its strain along
        paid_out = state[4] - (body.hook_offset if body else 0.0)
        stiffness, stretch, rate = rope.stiffness / paid_out, state[STRETCH], state[STRETCH_RATE]
        energy += 0.5 * stiffness * stretch**2
        power -= 0.5 * stiffness * stretch**2 * axes[2] / paid_out
        power -= plant.crane.viscosity[0] / paid_out * rate**2
    return float(energy), float(power)


@pytest.mark.parametrize(("drive", "room"), [("velocity", 3e-9), ("force", 1e-9)])
@pytest.mark.parametrize(
    ("names", "seconds"),
    [
        ((), 20.0), (("frame",), 2.0), (("body",), 2.0), (("wind",), 2.0), (("friction",), 2.0),
        (("rope",), 2.0), (("rope", "body", "frame", "wind", "friction"), 4.0),
    ],
)  # fmt: skip
def test_all_that_goes_in_is_stored_or_lost(
    names: tuple[str, ...], seconds: float, drive: Drive, room: float
) -> None:
    """To `room` of m g l; work by Simpson's rule, which leaves more where servos answer within a period."""
    effects = NUMBERS.only(*names)
    plant = ElasticPlant(RIG, drive=drive, step=0.5 * PERIOD, substeps=1, effects=effects)
    plant.reset(START)
    air, load, unit = WIND if effects.wind else np.zeros(6), np.zeros(7), RIG.weight * START[4]
    first, work, lost, swing = None, 0.0, 0.0, 0.0
    for k in range(round(seconds / PERIOD)):
        phase = np.array([1.0, 1.3, 0.7]) * k * PERIOD
        command = np.array([0.2, 0.15, 0.1]) * np.cos(phase)
        if drive == "force":
            command = command * RIG.driven_masses - [
                0.0,
                0.0,
                RIG.weight + 50.0 * (plant.state[4] - START[4]),
            ]
            command -= 10.0 * plant.state[1:6:2]
        told = [books(plant, effects, command, air)]
        for _ in range(2):
            plant.advance(command, np.zeros(2), air, load)
            told.append(books(plant, effects, command, air))
        first = told[0][0] if first is None else first
        power = [rate for _, rate in told]
        work += PERIOD / 6.0 * (power[0] + 4.0 * power[1] + power[2])
        lost = max(lost, abs(told[-1][0] - first - work))
        swing = max(swing, abs(work))
    assert lost < room * unit
    assert swing > 0.01 * unit
