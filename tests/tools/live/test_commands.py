"""Commands to a live session: parameters, pulses, velocity commands, and refused values."""

import json
import time
from dataclasses import replace

import numpy as np
import pytest

from cranectl.design import design_controller
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.tools.live.commands import Controls, LogText, Pulse, Reset, UseController
from cranectl.tools.live.hand import RELEASED, VELOCITY_TIMEOUT, HandRequest, LatestRequest
from tests.controllers.own_controllers import FOLLOWING, known
from tests.pace import within

NAMES = ["pause", "speed", "controller", "k0", "k1", "k2", "k3", "pulse_alpha", "pulse_beta"]


@pytest.fixture
def scenario() -> Scenario:
    return load_scenario("fixed-position")


@pytest.fixture
def controls(scenario: Scenario) -> Controls:
    return Controls(scenario, design_controller("lqr", scenario.design))


def test_parameters_have_their_initial_values(controls: Controls, scenario: Scenario) -> None:
    values = controls.values()
    assert list(values) == NAMES
    assert [values[name] for name in NAMES[3:7]] == design_controller("lqr", scenario.design).gain.tolist()
    assert (values["pause"], values["speed"], values["controller"]) == (False, 1.0, "lqr")
    assert controls.commands() == []


def test_pause_and_speed_can_be_set(controls: Controls) -> None:
    controls.set({"pause": True, "speed": 2})
    assert controls.paused
    assert controls.speed == 2.0
    assert [type(command) for command in controls.commands()] == [LogText, LogText]
    controls.set({"pause": True})
    assert controls.commands() == [], "an unchanged value gives a command"


def test_pulse_and_reset_are_commands(controls: Controls) -> None:
    controls.set({"pulse_beta": -1.5})
    controls.pulse()
    controls.reset()
    _, pulse, reset = controls.commands()
    assert pulse == Pulse((2.0, -1.5), 0.2)
    assert reset == Reset()


def test_a_pulse_causes_the_same_swing_on_cranes_of_any_size() -> None:
    """The swing is the angular speed after the pulse over the frequency of the pendulum."""
    swings = []
    for name in ("fixed-position", "ship-to-shore"):
        scenario = load_scenario(name)
        controls = Controls(scenario, design_controller("lqr", scenario.design))
        controls.pulse()
        (pulse,) = controls.commands()
        assert isinstance(pulse, Pulse)
        swings.append(pulse.acceleration[0] * pulse.seconds * np.sqrt(scenario.rig.rope_range[1] / 9.81))
    assert swings[1] == pytest.approx(swings[0], rel=0.01)


def test_another_controller_has_its_own_gains(controls: Controls, scenario: Scenario) -> None:
    controls.set({"controller": "pole-placement+hinf"})
    (command,) = controls.commands()
    design = design_controller("pole-placement+hinf", scenario.design)
    assert isinstance(command, UseController)
    assert command.design is design
    assert [controls.values()[name] for name in NAMES[3:7]] == design.gain.tolist()


def test_gains_that_are_set_together_are_one_change(controls: Controls) -> None:
    """If they were set one after the other, the first gain alone would make the loop unstable."""
    gain = np.poly([-6.0] * 4)[:0:-1].tolist()
    before = controls.values()
    controls.set({"k0": gain[0]})
    (refusal,) = controls.commands()
    assert isinstance(refusal, LogText)
    assert refusal.warning
    assert "unstable" in refusal.message
    assert controls.values() == before
    controls.set(dict(zip(NAMES[3:7], gain, strict=True)))
    (command,) = controls.commands()
    assert isinstance(command, UseController)
    assert command.design.gain.tolist() == gain
    assert controls.values()["controller"] == "lqr"


def test_gains_and_controller_can_be_set_together(controls: Controls) -> None:
    controls.set({"controller": "pole-placement", "k3": 11.0})
    (command,) = controls.commands()
    assert isinstance(command, UseController)
    assert command.design.name == "pole-placement, gains by hand"
    assert command.design.gain.tolist() == pytest.approx([39.0625, 62.5, 37.5, 11.0])


def test_another_controller_has_its_own_parameters(controls: Controls) -> None:
    controls.set({"controller": "pid", "pid.proportional": 3, "pid.shaper": "zvd"})
    (command,) = controls.commands()
    assert isinstance(command, UseController)
    assert (command.design.name, command.design.parameters["proportional"]) == ("pid", 3.0)
    values = controls.values()
    assert values["pid.shaper"] == "zvd"
    assert not {"k0", "k1"} & values.keys()
    controls.set({"k0": 100.0, "pid.derivative": -1.0})
    (refusal,) = controls.commands()
    assert "unknown parameter 'k0'" in refusal.message
    controls.set({"pid.derivative": -1.0})
    (refusal,) = controls.commands()
    assert "controller.pid.derivative = -1.0; allowed: a number from 0 to 100" in refusal.message
    controls.set({"controller": "lqr"})
    assert list(controls.values())[-4:] == ["k0", "k1", "k2", "k3"]
    assert "pid.shaper" not in controls.values()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"controller": "lqrr"}, "unknown controller 'lqrr'; allowed: pole-placement,"),
        ({"controller": 3.0}, "unknown controller '3.0'"),
        ({"k2": -1.0}, "unstable"),
        ({"k2": "much"}, "k2 = 'much'"),
        ({"k2": True}, "k2 = True"),
        ({"k2": float("nan")}, "k2 = nan"),
        ({"k2": None}, "k2 = None"),
        ({"controller": "lqr+hinf", "k0": 1e6}, "unstable"),
        (dict(zip(NAMES[3:7], np.poly([-2500.0] * 4)[:0:-1].tolist(), strict=True)), "allowed: a"),
        (
            dict(zip(NAMES[3:7], np.poly([-25.0, -25.0, -25.0, -2400.0])[:0:-1].tolist(), strict=True)),
            "sampled",
        ),
        ({"speed": 0.0}, "speed = 0.0; allowed: a number from 0.05 to 20"),
        ({"speed": 1e9}, "speed"),
        ({"pause": 1.0}, "pause = 1.0; allowed: true or false"),
        ({"pulse_alpha": 1e3}, "pulse_alpha"),
        ({"wind": 1.0}, "unknown parameter 'wind'"),
    ],
)
def test_wrong_values_are_refused_and_change_nothing(
    controls: Controls, changes: dict[str, object], message: str
) -> None:
    before = controls.values()
    controls.set(changes)
    (refusal,) = controls.commands()
    assert isinstance(refusal, LogText)
    assert refusal.warning
    assert "refused" in refusal.message
    assert message in refusal.message
    assert controls.values() == before


def test_long_names_and_values_are_refused_quickly(controls: Controls) -> None:
    """The search for similar names takes a time that grows with the square of their length."""
    start = time.process_time()
    controls.set({"controller": "lqr+" * 250_000})
    controls.set({"x" * 1_000_000: 1.0})
    controls.set({"speed": "7" * 1_000_000})
    assert within(time.process_time() - start, 1.0)
    refusals = [command for command in controls.commands() if isinstance(command, LogText)]
    assert [refusal.warning for refusal in refusals] == [True, True, True]
    assert all(len(refusal.message) < 10_000 for refusal in refusals)


def test_too_many_changes_at_once_are_refused(controls: Controls) -> None:
    before = controls.values()
    controls.set({"speed": 2.0, **{f"x{k}": 1.0 for k in range(100)}})
    assert controls.values() == before
    (refusal,) = controls.commands()
    assert refusal == LogText("101 parameters at once refused; allowed: 100", warning=True)


def test_a_wrong_value_does_not_affect_other_values(controls: Controls) -> None:
    controls.set({"speed": -1.0, "pause": True, "k0": 31.0})
    assert controls.paused
    assert controls.speed == 1.0
    assert controls.values()["k0"] == 31.0


def twist(x: object, y: object = 0.0, z: object = 0.0) -> bytes:
    return json.dumps({"linear": {"x": x, "y": y, "z": z}, "angular": {"x": 9.0}}).encode()


def test_a_velocity_command_is_valid_until_the_next_or_a_timeout(controls: Controls) -> None:
    now = 100.0
    limits, latest = controls.hand_limits, LatestRequest(clock=lambda: now)
    assert latest.take_new() == []
    latest.receive_velocity(twist(0.3, -0.1), limits)
    latest.receive_velocity(twist(0.4, -0.1), limits)
    assert latest.take_new() == [HandRequest(False, 0.4, -0.1, 0.0)], "only the newest command counts"
    now += 0.9 * VELOCITY_TIMEOUT
    latest.receive_velocity(twist(0.4, -0.1), limits)
    now += 0.9 * VELOCITY_TIMEOUT
    assert latest.take_new() == [], "a repeated command is not new"
    now += 0.2 * VELOCITY_TIMEOUT
    assert latest.take_new() == [RELEASED]
    assert latest.take_new() == []
    for _ in range(2):
        latest.receive_point(b'{"x": 1, "y": 1, "z": -1}', limits)
        assert latest.take_new() == [HandRequest(True, 1.0, 1.0, -1.0)], "a repeated target is a new command"
    now += 100.0
    assert latest.take_new() == [], "a target has no timeout"
    latest.receive_velocity(twist(0.0), limits)
    assert latest.take_new() == [RELEASED], "a velocity command of zero ends the motion to the target"


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (twist(0.48), "linear.x = 0.48; allowed: a number from -0.475 to 0.475"),
        (twist(0.0, z=-1e400), "linear.z = -inf"),
        (b'{"linear": {"x": NaN, "y": 0, "z": 0}}', "linear.x = nan"),
        (b'{"linear": {"x": 0.1, "y": 0}}', "linear = {'x': 0.1, 'y': 0}; allowed: an object of x, y, z"),
        (b'{"linear": 3}', "linear = 3"),
        (b"[1, 2, 3]", "linear = None"),
        (twist("0.1"), "linear.x = '0.1'"),
        (twist(True), "linear.x = True"),
        (twist(2**1023 - 1), "linear.x = 89884656743115"),
        (twist(2**1024 - 1), "the message is not valid JSON"),
        (b"\xff\x00", "the message is not valid JSON"),
        (b"[" * 100_000, "the message nests"),
    ],
)
def test_an_invalid_velocity_command_is_reported_once(
    controls: Controls, message: bytes, reason: str
) -> None:
    for _ in range(100):
        controls.drive_by_hand(message)
    (refusal,) = controls.commands()
    assert isinstance(refusal, LogText)
    assert refusal.warning
    assert "driving by hand refused: " in refusal.message
    assert reason in refusal.message
    controls.drive_by_hand(twist(0.1))
    controls.drive_by_hand(message)
    assert [type(command) for command in controls.commands()] == [LogText, HandRequest]


def test_a_target_outside_the_limits_is_refused(controls: Controls) -> None:
    controls.go(b'{"x": 1.0, "y": 1.0, "z": -1.39}')
    (refusal,) = controls.commands()
    assert "z = -1.39; allowed: a number from -1.3404 to -0.1; choose another z" in refusal.message
    controls.go(b'{"x": 1.0, "y": 1.0, "z": %d}' % (2**1024 - 1))
    (refusal,) = controls.commands()
    assert "driving by hand refused" in refusal.message


def test_a_controller_with_preview_cannot_take_over_while_driving_by_hand(controls: Controls) -> None:
    with known(replace(FOLLOWING, preview=1)) as name:
        controls.drive_by_hand(twist(0.1))
        assert controls.commands() == [HandRequest(False, 0.1, 0.0, 0.0)]
        controls.set({"controller": name})
        refusal = controls.commands()[0]  # the timeout of the velocity command may be a second one
        assert isinstance(refusal, LogText)
        assert "needs the reference in advance" in refusal.message
        assert controls.values()["controller"] == "lqr"
        controls.reset()
        controls.set({"controller": name})
        assert [type(command) for command in controls.commands()][:2] == [Reset, UseController]
