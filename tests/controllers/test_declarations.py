"""Declarations and results of `prepare` are checked before the run, and mistakes in them are refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.controllers.controller import Controller, Logged, Parameter
from cranectl.controllers.preparation import linearised, prepared
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.loaders.opening import open_controller
from cranectl.signals import Signal
from cranectl.support.errors import InputError


def pair(_: Any) -> Any:
    return np.zeros(1), np.zeros(2)


def controller(**declared: Any) -> Controller:
    return Controller(
        **{"name": "own", "title": "own", "step": Controller.called_by_address, "prepare": pair, **declared}
    )


def test_titles_are_those_of_the_declarations() -> None:
    """They are listed without loading what computes."""
    listed = {name: title for name, (origin, title) in ALL_CONTROLLERS.described().items()}
    assert listed == {name: controller.title for name, controller in ALL_CONTROLLERS.items()}


def logged(index: Any, name: Any = "x") -> tuple[Logged, ...]:
    return (Logged(index, Signal(name, name, "", "")),)


@pytest.mark.parametrize(
    ("declared", "found", "allowed"),
    [
        ({"name": 5}, "named '5'", "letters"),
        ({"step": 5}, "own.step = 5", "function"),
        ({"prepare": 5}, "own.prepare = 5", "function"),
        ({"command": "speed"}, "own.command = 'speed'", "acceleration, velocity, force"),
        ({"follows": 3}, "own.follows = 3", "path, set-point"),
        ({"measures": "all"}, "own.measures = 'all'", "state, encoders"),
        *(({"every": value}, "own.every", "1 to 1000000") for value in (0, -2, 1.5, "x", True, 10**30)),
        *(({"preview": value}, "own.preview", "0 to 1000000") for value in (-1, 0.5, "x", 10**12)),
        *(({"period": value}, "own.period", "1e-06 to 600") for value in (0.0, -1.0, 1e9, "x", True)),
        ({"every": 10, "period": 1e-6}, "own.period = 1e-06", "1e-05 to 6000"),
        ({"parameters": (1, 2)}, "own.parameters = (1, 2)", "cranectl.Parameter"),
        ({"parameters": (Parameter("k", 1.0, "", ""),) * 2}, "two parameters named 'k'", "of its own"),
        ({"parameters": (Parameter("", 1.0, "", ""),)}, "a parameter named ''", "one character"),
        ({"logged": 7}, "own.logged = 7", "cranectl.Logged"),
        ({"reads": ("mass",)}, "own.reads = 'mass'", "load_mass"),
        ({"reads": "path"}, "Controller.reads = 'path'", "a tuple"),
        ({"logged": logged(0, 5)}, "a signal named 5", "letters"),
        *(
            ({"logged": logged(index)}, "the place of 'x'", "0 to 999999")
            for index in (-1, -(2**63), 2**70, 0.5)
        ),
    ],
)
def test_a_declaration_of_another_kind_or_out_of_range_is_refused(
    declared: dict[str, Any], found: str, allowed: str
) -> None:
    with pytest.raises(InputError) as raised:
        controller(**declared)
    assert found in raised.value.found
    assert allowed in raised.value.allowed
    assert raised.value.remedy


def raising(_: Any) -> Any:
    raise ValueError("no gains")


def leaving(_: Any) -> Any:
    raise SystemExit(3)


@pytest.mark.parametrize(
    ("prepare", "found"),
    [
        (raising, "failed in test_declarations.py:"),
        (leaving, "SystemExit: 3"),
        (lambda: None, "takes 0 positional arguments"),
        (lambda _: None, "returns None"),
        (lambda _: np.zeros(3), "returns array"),
        (lambda _: ("a", "b"), "returns ('a', 'b')"),
        (lambda _: (np.zeros(1), np.zeros(2) * 1j), "complex128"),
        (lambda _: (np.zeros(1), np.broadcast_to(0.0, 10**7)), "10000000 numbers"),
        (lambda _: (np.zeros(1), np.zeros(10**15)), "MemoryError"),
    ],
)
def test_a_prepare_that_fails_or_returns_no_pair_is_refused(prepare: Any, found: str) -> None:
    with pytest.raises(InputError) as raised:
        prepared(controller(prepare=prepare), None)  # type: ignore[arg-type]
    assert found in raised.value.found
    assert "prepare" in raised.value.found
    assert "(parameters, memory)" in raised.value.allowed
    assert raised.value.remedy


def test_a_linearise_that_fails_or_returns_no_linear_controller_is_refused() -> None:
    for linearise, found in ((lambda *_: None, "returns None"), (lambda _: None, "takes 1 positional")):
        law = controller(linearise=linearise)
        with pytest.raises(InputError, match=f"linearise of own .*{found}"):
            linearised(law, None, 0.7)  # type: ignore[arg-type]


def test_an_input_error_of_prepare_is_not_changed() -> None:
    refusal = InputError("the load is too heavy", remedy="take a lighter one")

    def refusing(_: Any) -> Any:
        raise refusal

    with pytest.raises(InputError) as raised:
        prepared(controller(prepare=refusing), None)  # type: ignore[arg-type]
    assert raised.value is refusal


def test_whole_numbers_of_numpy_and_lists_will_do() -> None:
    law = controller(every=np.int64(5), logged=logged(np.int32(1)), prepare=lambda _: [[], [1, 2.5]])
    parameters, memory = prepared(law, None)  # type: ignore[arg-type]
    assert list(parameters) == [0.0]
    assert list(memory) == [1.0, 2.5]


LAW = """
class Own:
    {declared}

    def step(parameters, measured, reference, memory, command):
        return 0
"""


@pytest.mark.parametrize(
    ("declared", "found"),
    [
        *((f"memory = {value}", "own.memory = ") for value in (-3, "'abc'", "None", 3.5, "True", 10**12)),
        ("parameters = {'k': 'abc'}", "own.parameters: k = 'abc'"),
        ("parameters = {3: 5}", "Parameter.name = 3"),
        ("logged = {'x': 'abc'}", "the place of 'x' = 'abc'"),
        ("name = 5", "named '5'"),
        ("period = 'x'", "own.period = 'x'"),
    ],
)
def test_an_attribute_of_a_class_is_checked(declared: str, found: str, tmp_path: Path) -> None:
    path = tmp_path / "law.py"
    path.write_text(LAW.format(declared=declared))
    with pytest.raises(InputError) as raised:
        open_controller(f"{path}:Own")
    assert found in raised.value.found
    assert raised.value.allowed
    assert raised.value.remedy


def test_a_place_that_the_memory_does_not_have_is_refused_before_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, log = tmp_path / "law.py", tmp_path / "run.mcap"
    path.write_text(LAW.format(declared="memory, logged = 2, {'x': 5}"))
    assert main(["run", "fixed-position", "--controller", f"{path}:Own", "--out", str(log)]) == 2
    told = capsys.readouterr().err
    assert "logs place 5 of its memory as 'x'" in told
    assert "0 to 1: its memory has 2 numbers" in told
    assert not log.exists()
