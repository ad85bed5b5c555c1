"""Leave out of a model what costs the engine time and cannot change a bit of a run: half of its steps."""

import mujoco

from cranectl.scenario.effects import EffectSettings

DRAWN_ROPE = "rope"  # tendon
ENCODERS = (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL)


def leave_out_idle(spec: mujoco.MjSpec, effects: EffectSettings) -> None:
    """Take away what is only drawn, the encoders, which a run reads in qpos and qvel, and idle forces.

    All geoms are massless and touch nothing. The engine looks for springs, dampers and constraints at each
    stage of a step, of which the crane has only what effects bring; and for groups of bodies that constraints
    do not join, of which the crane is one. (Without a warm start friction would differ in the last digits,
    and take longer.)
    """
    encoders = [sensor for sensor in spec.sensors if sensor.type in ENCODERS]
    drawing = [*spec.geoms, spec.tendon(DRAWN_ROPE), *spec.materials, *spec.textures]
    drawing += [*spec.cameras, *spec.lights]
    for element in [*drawing, *encoders]:
        spec.delete(element)
    spec.stat.meansize = 1.0  # a scale of pictures, which the compiler would guess from the bodies
    idle = mujoco.mjtDisableBit
    _disable(spec, idle.mjDSBL_ISLAND)
    if not effects.friction:
        _disable(spec, idle.mjDSBL_CONSTRAINT, idle.mjDSBL_WARMSTART)
    if not effects.frame:
        _disable(spec, idle.mjDSBL_SPRING)
    if not (effects.frame or effects.friction or effects.body):
        _disable(spec, idle.mjDSBL_DAMPER)


def _disable(spec: mujoco.MjSpec, *flags: mujoco.mjtDisableBit) -> None:
    for flag in flags:
        spec.option.disableflags |= int(flag)
