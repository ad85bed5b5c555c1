"""The certificate of the six controllers: expected figures, soundness, refusals, and its command."""

import functools
import json
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.design import CONTROLLERS, design_controller
from cranectl.scenario import Scenario
from cranectl.scenario.load import default_scenario
from cranectl.simulate import PreparedController
from cranectl.tools.robustness.certificate.certify import (
    NominalLoop,
    certify,
    make_nominal_loop,
    make_nominal_loops,
)
from cranectl.tools.robustness.certificate.conservatism import (
    find_last_passing,
    find_limits,
    with_further_lag,
)
from cranectl.tools.robustness.certificate.linear_plant import ARRIVING, LinearPlant
from cranectl.tools.robustness.certificate.loop import InnerLoop, drive_slices
from cranectl.tools.robustness.certificate.nu_gap import NuGap
from cranectl.tools.robustness.certificate.operating_points import OperatingPoint
from cranectl.tools.robustness.certificate.structured import SAFETY_FACTOR, drive_margins

PERIOD = 1e-3
AXES = ("bridge", "trolley", "winch")
HANGING = OperatingPoint(0.7)


def scenario_of(lag: float = 0.02, delay: float = 0.0, *overrides: str) -> Scenario:
    lags = [f"rig.{axis}_time_constant={lag}" for axis in AXES]
    return default_scenario(overrides=[*lags, f"effects.delay.seconds={delay}", *overrides])


@functools.cache
def nominal_loop_of(controller: str) -> NominalLoop:
    scenario = default_scenario()
    return make_nominal_loop(scenario, design_controller(controller, scenario.design))


@functools.cache
def law_loops(*lengths: float) -> dict[float, NominalLoop]:
    scenario = default_scenario()
    points = [OperatingPoint(length) for length in lengths]
    return make_nominal_loops(scenario, ALL_CONTROLLERS.design("lqr-integral", scenario), points)


def gap_of(nominal_loop: NominalLoop, scenario: Scenario, point: OperatingPoint) -> float:
    graph = nominal_loop.opening.graph(nominal_loop.inner_loop(scenario, point, "velocity"))
    return NuGap.between(graph, nominal_loop.graph).gap


@pytest.mark.parametrize(("controller", "best"), [("pole-placement", 0.408), ("lqr", 0.568)])
def test_margin_of_loop_shaping_is_what_the_design_promises(controller: str, best: float) -> None:
    """1/gamma, 1 % below the best that any controller reaches; sampling takes next to nothing off."""
    nominal_loop = nominal_loop_of(f"{controller}+loop-shaping")
    assert nominal_loop.margin.margin == pytest.approx(nominal_loop.design.stability_margin, rel=2e-3)
    scenario = default_scenario(overrides=["design.loop_shaping.back_off=1.0002"])
    optimal = make_nominal_loop(scenario, design_controller(f"{controller}+loop-shaping", scenario.design))
    assert optimal.margin.margin == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_scales_at_v_are_the_best(controller: str) -> None:
    scenario = default_scenario()
    nominal_loop = make_nominal_loop(scenario, design_controller(controller, scenario.design), "v")
    plain = replace(nominal_loop.opening, scales=nominal_loop.design.gain)
    inner = nominal_loop.opening.axis.inner_loop()
    z = np.exp(1j * np.geomspace(1e-5, np.pi, 400))

    def margin(scales: np.ndarray) -> float:
        opening = replace(plain, scales=scales)
        graph, k = opening.graph(inner).response(z), opening.controller(z)
        full = np.linalg.inv(graph[:, -3:] - k @ graph[:, :-3])  # [N; M] (M - K N)^-1 [-K, I]
        closed = graph @ full @ np.concatenate([-k, np.broadcast_to(np.eye(3), (len(z), 3, 3))], axis=2)
        return float(1.0 / np.linalg.norm(closed, 2, axis=(1, 2)).max())

    best = margin(nominal_loop.opening.scales)
    assert nominal_loop.margin.margin == pytest.approx(best, rel=5e-3)
    rng = np.random.default_rng(0)
    for _ in range(6):
        assert margin(nominal_loop.opening.scales * np.exp(rng.normal(size=4) * 0.3)) < best * (1.0 + 2e-3)
    assert margin(nominal_loop.opening.scales * 3.0) < best


@pytest.mark.parametrize(
    ("lag", "delay", "pole_placement", "lqr"),
    [(0.005, 0.0, 0.005, 0.008), (0.02, 0.010, 0.034, 0.050), (0.05, 0.020, 0.085, 0.148)],
)
def test_gaps_of_an_uncompensated_loop(lag: float, delay: float, pole_placement: float, lqr: float) -> None:
    """Figures of an independent prototype, rope 0.7 m, lag not compensated; compensated, less is left."""
    scenario = scenario_of(lag, delay, "control.lag_compensation=false")
    for controller, gap in (("pole-placement", pole_placement), ("lqr", lqr)):
        nominal_loop = nominal_loop_of(f"{controller}+loop-shaping")
        found = gap_of(nominal_loop, scenario, HANGING)
        assert found == pytest.approx(gap, rel=0.06, abs=1.5e-3)
        assert gap_of(nominal_loop, scenario_of(lag, delay), HANGING) < 0.5 * found


@pytest.mark.parametrize(
    ("controller", "cases", "longest", "least"),
    [
        *((name, 20, 70, (2, 2)) for name in ("pole-placement", "lqr+hinf", "lqr+loop-shaping")),
        ("lqr-integral", 24, 150, (6, 3)),
    ],
)
def test_never_wrong_on_random_cranes(
    controller: str, cases: int, longest: int, least: tuple[int, int]
) -> None:
    """Lag, delay, gain of the drives, rope, tilt, speed at random: what is certified is stable."""
    flat = controller in CONTROLLERS
    rng = np.random.default_rng(CONTROLLERS.index(controller) if flat else 5)
    certified = unstable = 0
    for case in range(cases):
        lag, delay = 10.0 ** rng.uniform(-2.7, -0.7), int(rng.integers(0, 10 if case % 2 else longest))
        if flat:
            loop = nominal_loop_of(controller)
            point = OperatingPoint(
                float(rng.uniform(0.15, 1.35)),
                (float(rng.normal()), float(rng.normal())) if rng.random() < 0.4 else (0.0, 0.0),
                float(rng.uniform(-0.5, 0.5)),
            )
        else:
            point = OperatingPoint((0.2, 0.7, 1.3)[case % 3])
            loop = law_loops(0.2, 0.7, 1.3)[point.rope_length]
        overrides = ["control.lag_compensation=false"] if flat and rng.random() < 0.5 else []
        plant = loop.plant(scenario_of(lag, 0.0, *overrides), point, "velocity")
        b = plant.system.b.copy()
        drives, _ = drive_slices(plant.system)
        b[:, drives] *= 10.0 ** (rng.uniform(-0.05, 0.05) if case % 2 else rng.uniform(-0.8, 0.8))
        plant = replace(plant, system=plant.system._replace(b=b), delay=delay)
        verdict = loop.judge(loop.close(plant), point)
        assert verdict.stable or not verdict.certified
        certified += verdict.certified
        unstable += not verdict.stable
    assert certified >= least[0]
    assert unstable >= least[1], "the cases are too tame to prove anything"


def test_drive_margins_are_safe_and_not_far_off() -> None:
    """Gains and delays that differ from drive to drive, within the tolerated: all stable. Beyond: not."""
    nominal_loop, scenario = nominal_loop_of("lqr+loop-shaping"), scenario_of(0.02, 0.01)
    plant = LinearPlant.of(scenario, OperatingPoint(0.5, (0.5, 0.0)), "velocity")
    inner = InnerLoop.of(plant, nominal_loop.design.gain)
    margins = drive_margins(inner, nominal_loop.opening.axis.robustifier, PERIOD)

    def stable(gains: np.ndarray, delay: int) -> bool:
        b = plant.system.b.copy()
        b[:, ARRIVING] *= gains
        changed = replace(plant, system=plant.system._replace(b=b), delay=plant.delay + delay)
        loop = InnerLoop.of(changed, nominal_loop.design.gain)
        return loop.closed_loop_radius(nominal_loop.opening.axis.robustifier) < 1.0

    rng = np.random.default_rng(0)
    for spread, delay in margins.delays[1:3]:
        assert delay > 0.0
        assert stable(1.0 + spread * rng.uniform(-1, 1, size=3), int(delay / PERIOD))
    low, high = margins.gain_range
    for corner in ((low, high, high), (high, low, 1.0), (low, low, low), (high, high, high)):
        assert stable(np.array(corner) ** 0.999, 0)
    assert not stable(np.ones(3), int(1.1 * margins.delays[0][1] / PERIOD) + 1)
    assert not stable(np.array([1.0, 1.0, -1.0]), 0)
    assert list(margins.delays) == sorted(margins.delays, key=lambda pair: -pair[1])
    late = nominal_loop.inner_loop(scenario_of(0.02, 0.2), HANGING, "velocity")
    none = drive_margins(late, nominal_loop.opening.axis.robustifier, PERIOD)
    assert (none.disk_margin, none.gain_range) == (0.0, (1.0, 1.0)), "of an unstable loop"
    assert not any(delay for _, delay in none.delays)


def test_disk_margin_of_one_drive_is_python_controls() -> None:
    """Hanging, the bridge moves alone: opened there, the loop has one input and one output."""
    nominal_loop = nominal_loop_of("lqr")
    inner = nominal_loop.inner_loop(scenario_of(), HANGING, "velocity")
    closed = inner.closed_loop(nominal_loop.opening.axis.robustifier)  # T' = -T
    omega = np.geomspace(0.1, 100.0, 400)
    t = -closed.response(np.exp(1j * omega * PERIOD))
    assert np.abs(t[:, 0, 1:]).max() < 1e-6 * np.abs(t).max()
    bridge = control.ss(closed.a, closed.b[:, :1], -closed.c[:1], -closed.d[:1, :1], PERIOD)
    loop = control.feedback(bridge, 1.0, sign=1)  # T / (1 - T)
    expected, *_ = control.disk_margins(loop, omega)
    assert 1.0 / np.abs(0.5 - t[:, 0, 0]).max() == pytest.approx(float(expected), rel=1e-3)
    together = drive_margins(inner, nominal_loop.opening.axis.robustifier, PERIOD).disk_margin
    alone = 1.0 / np.abs(0.5 - np.diagonal(t, 0, 1, 2)).max()
    assert together == pytest.approx(alone / SAFETY_FACTOR, rel=1e-3)


@pytest.mark.parametrize("last", [0, 1, 15, 16, 17, 47, 48, 99, 100])
def test_the_last_good_number_is_found(last: int) -> None:
    assert find_last_passing(lambda k: k <= last, 0, 100) == last
    assert find_last_passing(lambda k: k <= last, last + 1, 100) is None


def test_limits_certified_lie_below_those_survived() -> None:
    scenario = scenario_of()
    limits = find_limits(nominal_loop_of("pole-placement"), scenario, HANGING, "ideal")
    assert limits.delay_certified is not None
    assert limits.delay_stable is not None
    assert 0.02 < limits.delay_certified <= limits.delay_stable < 0.2
    assert limits.lag_certified is None
    assert with_further_lag(scenario, 0.01).rig.time_constants == pytest.approx([0.03] * 3)


def test_a_certificate_knows_its_worst_point() -> None:
    points = [OperatingPoint(0.7), OperatingPoint(0.7, (2.0, 2.0)), OperatingPoint(0.2)]
    loops = {point.rope_length: nominal_loop_of("pole-placement+loop-shaping") for point in points}
    found = certify(loops, scenario_of(), points, drive="velocity")
    assert found.worst.point == points[1]
    assert not found.certified
    assert found.points[0].certified
    assert found.to_json()["least_margin"] < 0.0


COMMAND = ["certify", "lqr+loop-shaping", "--rope-length", "0.7", "--tilt", "0", "0", "--hoisting-speed", "0"]


def test_command_certifies(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pictures = [tmp_path / "a.svg", tmp_path / "b.svg"]
    for picture in pictures:
        assert main([*COMMAND, "--delay", "0.01", "--plot", str(picture), "--json", "-"]) == 0
        data = json.loads(capsys.readouterr().out)
    assert pictures[0].read_bytes() == pictures[1].read_bytes()
    assert data["certified"] is True
    assert data["opened_at"] == "v-bar"
    assert data["delay"] == 0.01
    assert data["worst"]["gap"] + data["least_margin"] == pytest.approx(data["margin"])
    assert 0.2 < data["drive_margins_at_worst"]["disk_margin"] < 2.0


def test_command_takes_effects_in_and_names_what_it_leaves_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    effects = [f"--set=effects.{name}={{}}" for name in ("body", "friction", "limits")]
    file = tmp_path / "a.json"
    assert main(["certify", "lqr", *COMMAND[2:], *effects, "--json", str(file)]) == 1
    data, screen = json.loads(file.read_text()), capsys.readouterr().out
    for key, label, expected in (
        ("taken_in", "in the linear loop", ["body", "friction.viscous", "friction.pivot_viscous"]),
        ("left_out", "left out", ["limits", "friction.coulomb", "friction.pivot_coulomb"]),
    ):
        assert data[key] == expected
        assert f"{label}: {', '.join(expected)}" in screen


def test_command_refuses_with_code_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*COMMAND, "--delay", "0.2"]) == 1
    screen = capsys.readouterr().out
    assert "refused (r): 1; truly unstable (u): 1" in screen
    assert "1.000 u" in screen
    for delay, found in (("-1", "delay"), ("1", "a delay of 1000 control periods")):
        assert main([*COMMAND, "--delay", delay]) == 2
        assert found in capsys.readouterr().err


def test_the_design_model_of_a_law_is_the_crane_with_ideal_drives() -> None:
    """Hence next to no gap; and its closed loop has the poles that the design says."""
    scenario, loop = default_scenario(), law_loops(0.2, 0.7, 1.3)[0.7]
    verdict = loop.judge(loop.inner_loop(scenario, HANGING, "ideal"), HANGING)
    assert verdict.gap < 1e-3
    assert verdict.certified
    law = PreparedController.near_rest(scenario, loop.design, [0.7])[0]
    slowest = np.linalg.eigvals(law.a - law.b @ law.gain[np.newaxis]).real.max()
    assert np.log(verdict.closed_loop_radius) / PERIOD == pytest.approx(slowest, rel=0.02)


def test_a_law_is_judged_where_its_linearisation_holds(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["certify", "lqr-integral", "--rope-length", "0.7"]
    assert main([*command, "--delay", "0.01", "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert (data["opened_at"], len(data["points"])) == ("u", 1)
    assert main([*command, "--delay", "0.15"]) == 1
    capsys.readouterr()
    for arguments, found in (
        ([*command, "--tilt", "1", "1"], "a load that hangs at rest"),
        ([*command, "--set", "effects.wind.mean=[1,0,0]"], "no mean wind"),
        ([*command, "--open-at", "v"], "u for other controllers"),
        (["certify", "lqr", "--open-at", "v-bar"], "the loop of lqr opened at 'v-bar'"),
        (["certify", "pid"], "'pid' has no linear design"),
    ):
        assert main(arguments) == 2
        assert found in capsys.readouterr().err
