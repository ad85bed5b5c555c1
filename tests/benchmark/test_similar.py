"""Defaults scale to cranes of other sizes by Froude's similarity, so every controller commands the same."""

import ctypes
from ctypes import POINTER, c_double

import numpy as np
import pytest

from cranectl.controllers.controller import Controller, Nominal
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.similarity import completed_rig
from cranectl.support.arrays import Array
from cranectl.support.compiled_step import CompiledStep
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.settings import Benchmark

CONTROLLERS = [name for name in Benchmark.read("literature").laws if ".py:" in name]
LENGTH, MASS, PERIOD = 25.0, 1000.0, 1e-3
SMALL = RigParameters()
LARGE = RigParameters(
    **completed_rig({"rope_range": [0.05 * LENGTH, 1.4 * LENGTH], "load_mass": MASS, "rated_load": MASS})
)
SAMPLES, PREVIEW_SAMPLES = 60, 4  # fewer for controllers with preview, which plan at every sample
Step = ctypes.CFUNCTYPE(ctypes.c_int64, *[POINTER(c_double)] * 5)


def path(samples: int, *, moves: bool) -> Array:
    """Return the reference (samples, 15) of a load that circles while hoisted, or that stands still."""
    centre, radius, rate = np.array([0.8, 0.7, -0.8]), np.array([0.3, 0.2, 0.15]), 2.0
    phase = rate * PERIOD * np.arange(samples)[:, np.newaxis] + np.arange(3)
    rows = [radius * rate**k * np.sin(phase + 0.5 * k * np.pi) for k in range(5)]
    rows[0] = rows[0] + centre
    return np.hstack(rows) if moves else np.tile([1.2, 1.0, -0.6, *[0.0] * 12], (samples, 1))


def states(samples: int, deviation: float) -> Array:
    """Return measurements (samples, 12) about a crane whose rope leans a little."""
    about = np.array([0.8, 0, 0.7, 0, 0.8, 0, 0.1, 0, -0.1, 0, 0, 0])
    spread = np.array([0.03, 0.1, 0.03, 0.1, 0.02, 0.1, 0.05, 0.2, 0.05, 0.2, 0.2, 0.2])
    return about + deviation * spread * np.random.default_rng(5).standard_normal((samples, 12))


def commands(controller: Controller, rig: RigParameters, length: float, mass: float) -> Array:
    """Return commands (samples, 3) on a `rig` of another size, scaled to units of the small rig."""
    time = np.sqrt(length)
    of_state = np.array([*[length, length / time] * 3, *[1.0, 1.0 / time] * 2, *[1.0 / time**2] * 2])
    of_path = np.repeat([length / time**k for k in range(5)], 3)
    samples = PREVIEW_SAMPLES if controller.preview else SAMPLES
    reference = path(samples + controller.preview, moves=controller.follows == "path") * of_path
    measurements = states(samples, 1.0 if controller.measures == "state" else 0.02) * of_state
    values = {number.name: number.sized(number.default, length) for number in controller.parameters}
    period = PERIOD * controller.every * time
    prepared = controller.prepare(
        Nominal(rig, "velocity", period, reference[:samples], measurements[0, :10], values)
    )
    parameters, memory = (np.array(array, dtype=np.float64) for array in prepared)
    step, result = Step(CompiledStep.address_of(controller.step)), np.zeros((samples, 3))
    for k in range(samples):
        measured = (
            measurements[k]
            if controller.measures == "state"
            else np.ascontiguousarray(measurements[k, :10:2])
        )
        arguments = (parameters, measured, reference[k:], memory, result[k])
        assert step(*(array.ctypes.data_as(POINTER(c_double)) for array in arguments)) == 0
    units = {"acceleration": length / time**2, "velocity": length / time, "force": mass * length / time**2}
    return result / units[controller.command]


@pytest.mark.parametrize("reference", CONTROLLERS)
def test_controller_commands_the_same_on_similar_cranes(reference: str) -> None:
    (name,) = measured_controllers(Benchmark.read("literature"), [reference])
    controller = ALL_CONTROLLERS[name]
    small, large = commands(controller, SMALL, 1.0, 1.0), commands(controller, LARGE, LENGTH, MASS)
    size = np.abs(small).max(axis=0)
    assert (size > 0.0).all()
    # Defaults on the large crane are rounded to three digits, which is at most half a percent.
    assert (np.abs(large - small).max(axis=0) < 5e-3 * size).all()
