"""Defaults go to cranes of other sizes by Froude's similarity: every law then commands the same there."""

import ctypes
from ctypes import POINTER, c_double

import numpy as np
import pytest

from cranectl.campaign.benchmark.settings import read_benchmark
from cranectl.cli.benchmark import measured_controllers
from cranectl.controllers.controller import Controller, Nominal
from cranectl.controllers.registry import load_controller
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.similarity import completed_rig
from cranectl.support.arrays import Array
from cranectl.support.jit import address_of

LAWS = [law for law in read_benchmark("literature").laws if ".py:" in law]
LENGTH, MASS, PERIOD = 25.0, 1000.0, 1e-3
SMALL = RigParameters()
LARGE = RigParameters(
    **completed_rig({"rope_range": [0.05 * LENGTH, 1.4 * LENGTH], "load_mass": MASS, "rated_load": MASS})
)
SAMPLES, PREVIEWED = 60, 4  # of laws that see ahead fewer: each plans
Step = ctypes.CFUNCTYPE(ctypes.c_int64, *[POINTER(c_double)] * 5)


def path(samples: int, *, moves: bool) -> Array:
    """(samples, 15) of a load that circles and is hoisted, or that is somewhere."""
    centre, radius, rate = np.array([0.8, 0.7, -0.8]), np.array([0.3, 0.2, 0.15]), 2.0
    phase = rate * PERIOD * np.arange(samples)[:, np.newaxis] + np.arange(3)
    rows = [radius * rate**k * np.sin(phase + 0.5 * k * np.pi) for k in range(5)]
    rows[0] = rows[0] + centre
    return np.hstack(rows) if moves else np.tile([1.2, 1.0, -0.6, *[0.0] * 12], (samples, 1))


def states(samples: int, deviation: float) -> Array:
    """(samples, 12) of what a law is told, about a crane that leans a little."""
    about = np.array([0.8, 0, 0.7, 0, 0.8, 0, 0.1, 0, -0.1, 0, 0, 0])
    spread = np.array([0.03, 0.1, 0.03, 0.1, 0.02, 0.1, 0.05, 0.2, 0.05, 0.2, 0.2, 0.2])
    return about + deviation * spread * np.random.default_rng(5).standard_normal((samples, 12))


def commands(law: Controller, rig: RigParameters, length: float, mass: float) -> Array:
    """(samples, 3) of `law` on `rig`, on which all is so many times as large, in units of the small one."""
    time = np.sqrt(length)
    of_state = np.array([*[length, length / time] * 3, *[1.0, 1.0 / time] * 2, *[1.0 / time**2] * 2])
    of_path = np.repeat([length / time**k for k in range(5)], 3)
    samples = PREVIEWED if law.preview else SAMPLES
    reference = path(samples + law.preview, moves=law.follows == "path") * of_path
    told = states(samples, 1.0 if law.measures == "state" else 0.02) * of_state
    given = {each.name: each.sized(each.default, length) for each in law.parameters}
    period = PERIOD * law.every * time
    prepared = law.prepare(Nominal(rig, "velocity", period, reference[:samples], told[0, :10], given))
    parameters, memory = (np.array(each, dtype=np.float64) for each in prepared)
    step, found = Step(address_of(law.step)), np.zeros((samples, 3))
    for k in range(samples):
        measured = told[k] if law.measures == "state" else np.ascontiguousarray(told[k, :10:2])
        arguments = (parameters, measured, reference[k:], memory, found[k])
        assert step(*(each.ctypes.data_as(POINTER(c_double)) for each in arguments)) == 0
    units = {"acceleration": length / time**2, "velocity": length / time, "force": mass * length / time**2}
    return found / units[law.command]


@pytest.mark.parametrize("reference", LAWS)
def test_a_law_does_the_same_on_a_similar_crane(reference: str) -> None:
    (name,) = measured_controllers(read_benchmark("literature"), [reference])
    law = load_controller(name)
    small, large = commands(law, SMALL, 1.0, 1.0), commands(law, LARGE, LENGTH, MASS)
    size = np.abs(small).max(axis=0)
    assert (size > 0.0).all()
    # Defaults on the larger one are rounded to three digits, which is half a percent at most.
    assert (np.abs(large - small).max(axis=0) < 5e-3 * size).all()
