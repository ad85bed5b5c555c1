"""Plants that the loop calls by address."""

import numpy as np
import pytest
from numba.core.errors import TypingError

from cranectl.design import design_controller
from cranectl.planning import load_scenario
from cranectl.plants.addressed import AddressedPlant, advance_addressed, measure_addressed
from cranectl.plants.analytic import AnalyticPlant, advance, measure_joints, no_warnings
from cranectl.plants.plant import Kernels
from cranectl.scenario.rig import RigParameters
from cranectl.signals import BRIDGE_RATE
from cranectl.simulate import Loop, PreparedController
from cranectl.simulate.plan import Plan
from cranectl.status import RunStatus
from cranectl.support.jit import jit
from tests.conftest import STILL
from tests.plants.cranes import make

COMMAND = (0.3, -0.2, 0.1)


def plant(load_mass: float = 1.0) -> AnalyticPlant:
    start = np.array([0.1, 0.2, 0.3, 0.0, 0.8, 0.1, 0.05, 0.2, -0.04, 0.1])
    rig = RigParameters(load_mass=load_mass)
    return make("analytic", drive="velocity", rig=rig, substeps=2, start=start)


def after_a_period(of: AnalyticPlant, *, addressed: bool) -> list[float]:
    """Joints and load, by address or by calling the kernels from Python."""
    state, load = np.zeros(10), np.zeros(7)
    if addressed:
        called = AddressedPlant.of(of.kernels, of.handle)
        advance_addressed(called, COMMAND, np.zeros(2), STILL, load)
        measure_addressed(called, state)
    else:
        of.advance(np.array(COMMAND), np.zeros(2), STILL, load)
        of.measure(state)
    return [*state, *load]


def test_a_call_by_address_does_what_the_kernels_do() -> None:
    assert after_a_period(plant(), addressed=True) == after_a_period(plant(), addressed=False)


def test_plants_of_one_kind_share_their_code_and_not_their_numbers() -> None:
    light, heavy = plant(), plant(load_mass=50.0)
    addresses = {AddressedPlant.of(each.kernels, each.handle).address for each in (light, heavy)}
    assert len(addresses) == 1
    assert after_a_period(light, addressed=True) != after_a_period(heavy, addressed=True)


def test_an_array_with_gaps_is_refused() -> None:
    of = plant()
    called = AddressedPlant.of(of.kernels, of.handle)
    with pytest.raises(TypingError):
        advance_addressed(called, COMMAND, np.zeros(4)[::2], STILL, np.zeros(7))


@jit
def break_down(handle, command, disturbance, wind, load):  # type: ignore[no-untyped-def]
    advance(handle, command, disturbance, wind, load)
    if abs(handle.state[BRIDGE_RATE]) > 1e-3:
        raise ValueError("the bridge broke")


class Fragile(AnalyticPlant):
    """Its kernel raises an exception beyond a speed of the bridge."""

    kernels = Kernels(measure_joints, break_down, no_warnings)


def test_an_exception_in_a_kernel_ends_the_run_and_is_reported(capfd: pytest.CaptureFixture[str]) -> None:
    scenario = load_scenario("fixed-position", overrides=["initial.load_offset=[0.02,0.0,0.0]"])
    crane = Fragile(scenario.rig, drive="ideal", step=1e-3, substeps=1)
    design, plan = (design_controller("lqr", scenario.design), Plan.of(scenario))
    controller = PreparedController.of(scenario, design, "ideal", plan)
    run = Loop(plan, crane, controller).run()
    assert run.status == RunStatus.ENGINE_WARNING
    assert 0 < len(run.table) < len(plan.time_ns)
    assert "failed in test_addressed.py:" in capfd.readouterr().err
