"""A run whose log would be too large to read is refused before it starts; allowed logs can be read."""

from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.controllers.controller import Controller, Logged
from cranectl.controllers.registry import OPEN, register_controller
from cranectl.design.records import ControllerDesign, Origin
from cranectl.loaders.opening import close_controllers
from cranectl.log import topics
from cranectl.log.header import check_recordable
from cranectl.log.reader import read_log, read_signal
from cranectl.log.writer import write_log
from cranectl.scenario import Scenario
from cranectl.signals import Signal, SignalGroup
from cranectl.simulate import simulate_run
from cranectl.support.documents import MAX_DOCUMENT_BYTES
from cranectl.support.errors import InputError

SERVO = """\
class Chatty:
    \"\"\"A PD controller that logs many signals.\"\"\"
    memory = 1500
    logged = {f"signal_number_{k}": k for k in range(1500)}
    @staticmethod
    def step(parameters, measured, reference, memory, command):
        for axis in range(3):
            target = -reference[2] if axis == 2 else reference[axis]
            command[axis] = 4.0 * (target - measured[2 * axis]) - 4.0 * measured[2 * axis + 1]
        return 0
"""


RUN_OPTIONS = ["--set", "duration=4", "--set", "disturbances=[]"]


def signals(*names: str) -> tuple[Signal, ...]:
    return tuple(Signal(name, name, "", "") for name in names)


def count_up(parameters, measured, reference, memory, command):
    for axis in range(3):
        command[axis] = parameters[0] * (measured[0] + reference[0])
    for k in range(2100):
        memory[k] += k
    return 0


def counter(*names: str) -> Controller:
    """Return a controller that holds the crane and logs signals with these names."""
    return Controller(
        name="counter",
        title="counts",
        step=count_up,
        prepare=lambda _: (np.zeros(1), np.zeros(2100)),
        logged=tuple(Logged(k, signal) for k, signal in enumerate(signals(*names))),
    )


def test_too_many_signals_are_refused_before_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, log = tmp_path / "law.py", tmp_path / "out" / "run.mcap"
    file.write_text(SERVO)
    arguments = ["--controller", f"{file}:Chatty", "--plants", "analytic", *RUN_OPTIONS]
    try:
        assert main(["run", "fixed-position", *arguments, "--out", str(log)]) == 2
        error = capsys.readouterr().err
        assert "the 1500 signals that chatty logs" in error
        assert "log fewer signals" in error
        assert not log.exists()
        file.write_text(SERVO.replace("range(1500)", "range(1000)"))
        close_controllers()
        assert main(["run", "fixed-position", *arguments, "--out", str(log)]) in (0, 1)
    finally:
        close_controllers()
    assert main(["info", str(log)]) == 0


def test_the_maximum_number_of_signals_is_read_back(tmp_path: Path, short: Scenario) -> None:
    """From field 2048 on, the tag of a field takes three bytes."""
    register_controller(counter(*(f"n{k}" for k in range(2100))))
    try:
        run = simulate_run(short, plant="analytic", controller="counter")
        log = write_log(tmp_path / "counts.mcap", [run])
    finally:
        del OPEN.registered["counter"]
    assert np.array_equal(read_log(log)["analytic"].block("controller"), run.every(4).block("controller"))
    _, last = read_signal(log, "analytic/controller.n2099")
    assert last[1] == 5 * 2099


def test_a_long_source_is_refused_before_the_run(short: Scenario) -> None:
    origin = Origin("law.py:Mine", "0" * 64, "# 3\n" * (MAX_DOCUMENT_BYTES // 4))
    design = ControllerDesign("mine", origin=origin)
    with pytest.raises(InputError, match=r"the run of .* with mine cannot be logged: design\.json is larger"):
        check_recordable(short, design, "ideal")


@pytest.mark.parametrize(
    "names", [("a b",), ("a.b",), ("",), ("ü",), ("1a",), ("x/y",), ("n\x00",), ("a", "a"), ("x" * 201,)]
)
def test_invalid_signal_names_are_refused(names: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match=r"counter logs (a signal|two signals) named .*\n.*letters A to Z"):
        counter(*names)


@pytest.mark.parametrize(
    "names", [("_hidden", "hidden"), ("__x", "_x", "x"), ("bridgeSpeed", "bridge_speed"), ("x" * 200,)]
)
def test_allowed_signal_names_are_valid_in_protobuf(names: tuple[str, ...]) -> None:
    counter(*names)
    definition = topics.group_schema(SignalGroup("controller", "Counter", "", signals(*names)))
    assert topics.encode(definition, "Counter", dict.fromkeys(names, 1.0))
