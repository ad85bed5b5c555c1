"""Test the numbers that tuning may change, and their declared bounds."""

import pytest

from cranectl import open_controller
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.planning import load_scenario
from cranectl.support.errors import InputError
from cranectl.tools.benchmark.declared import Variable, assignments, variables_of
from cranectl.tools.benchmark.settings import Benchmark
from tests.benchmark.conftest import close_opened_controllers
from tests.conftest import ROOT

__all__ = ["close_opened_controllers"]

NEGATIVE = Variable("controller.a.k", -4.0, 1.0, 100.0, -0.5)


def test_positions_are_logarithmic_and_keep_the_sign() -> None:
    assert [NEGATIVE.value_at(position) for position in (0.0, 0.5, 1.0)] == [-1.0, -10.0, -100.0]
    assert NEGATIVE.value_at(NEGATIVE.start_position) == -4.0
    assert NEGATIVE.value_at(1.0 / 3.0) == -4.642  # four digits, so that the printed value is the used one
    assert NEGATIVE._replace(start=0.0).start_position == 0.0
    assert NEGATIVE._replace(start=1e3).start_position == 1.0


def test_variables_are_those_that_the_controller_declares() -> None:
    names = [variable.key for variable in variables_of("lqr-integral")]
    declared = [parameter for parameter in ALL_CONTROLLERS["lqr-integral"].parameters if parameter.search]
    assert names == [f"controller.lqr-integral.{parameter.name}" for parameter in declared]
    assert [(variable.low, variable.high) for variable in variables_of("lqr-integral")] == [
        parameter.search for parameter in declared
    ]
    with pytest.raises(InputError, match="unknown controller 'lrq'"):
        variables_of("lrq")


def test_variables_of_the_flat_family_are_those_of_its_parts() -> None:
    parts = {name: [variable.key for variable in variables_of(name)] for name in FLAT_FAMILY}
    assert parts["pole-placement"] == [f"design.poles.{k}" for k in range(4)]
    assert parts["lqr"] == [f"design.state_weights.{k}" for k in range(4)]
    hinf = [f"design.hinf.{name}" for name in ("bandwidth", "offset", "control_weight")]
    shaped = [f"design.loop_shaping.{name}" for name in ("proportional", "integral")]
    for feedback in ("pole-placement", "lqr"):
        assert parts[f"{feedback}+hinf"] == parts[feedback] + hinf
        assert parts[f"{feedback}+loop-shaping"] == parts[feedback] + shaped
    poles, weights = variables_of("pole-placement"), variables_of("lqr")
    assert [
        (variable.start, variable.value_at(0.0), variable.value_at(1.0), variable.length_power)
        for variable in poles
    ] == [(-2.5, -0.8, -24.0, -0.5)] * 4
    assert [variable.length_power for variable in weights] == [-4.0, -3.0, -2.0, -1.0]


@pytest.mark.parametrize("name", sorted({*FLAT_FAMILY, *Benchmark.read("literature").laws}))
def test_values_at_both_bounds_are_allowed(name: str) -> None:
    if ":" in name:
        name = open_controller(str(ROOT / "validation" / "benchmark" / name))
    variables = variables_of(name)
    for position in (0.0, 1.0):
        settings = assignments(variables, [variable.value_at(position) for variable in variables])
        scenario = load_scenario("fast-diagonal", overrides=settings)
        if name not in FLAT_FAMILY:
            ALL_CONTROLLERS[name].designed(scenario.controller.parameters.get(name, {}))
    for variable in variables:
        assert 0.0 < variable.low <= abs(variable.start) <= variable.high


def test_values_are_scaled_to_the_crane_of_a_scenario() -> None:
    poles = variables_of("pole-placement")
    start = [variable.start for variable in poles]
    assert assignments(poles, start) == []
    changed = [-4.0, *start[1:]]
    scenario = load_scenario("fast-diagonal", overrides=assignments(poles, changed))
    assert scenario.design.poles == tuple(changed)
    harbour = load_scenario("ship-to-shore")
    length = harbour.rig.design_scale
    assert length > 20.0
    scaled = load_scenario("ship-to-shore", overrides=assignments(poles, changed, length))
    assert scaled.design.poles[1:] == harbour.design.poles[1:]
    assert scaled.design.poles[0] == pytest.approx(-4.0 * length**-0.5, rel=5e-3)
    assert assignments([NEGATIVE], [-8.0], 4.0) == ["controller.a.k=-4.0"]
