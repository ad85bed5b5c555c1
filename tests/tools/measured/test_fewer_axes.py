"""Logs of a cart with a pendulum, from its textbook equation: nobody measures what cannot move."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl.cli.main import main
from cranectl.scenario import RigFile
from cranectl.support import Array, InputError
from cranectl.tools.measured.importing import import_files
from cranectl.tools.measured.mapping import MeasuredMap

LENGTH, GRAVITY, LAG = 0.4, 9.81, 0.06  # [m, m/s², s]
CART, LOAD = 0.7, 0.2  # [kg]
CONSTANT = {
    "trolley_position": {"value": 0.0, "unit": "mm"},
    "alpha": {"value": 0.0, "unit": "deg"},
    "trolley_command": {"value": 0.0, "unit": "mm/s"},
    "rope_command": {"value": 0.0, "unit": "m/s"},
}
MAP: dict[str, Any] = {
    "name": "cart",
    "rig": "cart-pendulum",
    "commands": "velocity",
    "time": {"column": "t"},
    "signals": {
        "bridge_position": {"column": "cart", "unit": "mm"},
        "beta": {"column": "angle", "unit": "deg"},
        "rope_length": {"value": 40.0, "unit": "cm"},
        "bridge_command": {"column": "set-point", "unit": "mm/s"},
    },
}
TEXT = """\
name = "cart"
rig = "cart-pendulum"
commands = "velocity"
time.column = "t"

[signals]
bridge_position = {column = "cart", unit = "mm"}
beta = {column = "angle", unit = "deg"}
rope_length = {value = 40.0, unit = "cm"}
bridge_command = {column = "set-point", unit = "mm/s"}
"""


def measure(path: Path, amplitude: float, period: float) -> Array:
    """Write a log of a cart whose velocity lags its set-points, and return its columns in SI units."""
    time = np.arange(0.0, 8.0, 0.01)
    moves = (time >= 1.5) & (time < 6.0)
    set_points = amplitude * np.sign(np.sin(2.0 * np.pi * (time - 1.5) / period)) * moves

    def rates(now: float, state: Array) -> list[float]:
        _, speed, angle, rate = state
        push = CART / LAG * (set_points[min(int(now / 0.01 + 1e-9), len(time) - 1)] - speed)
        pull = LOAD * (LENGTH * rate**2 + GRAVITY * np.cos(angle)) * np.sin(angle)  # of the rope on the cart
        acceleration = (push + pull) / (CART + LOAD * np.sin(angle) ** 2)
        return [speed, acceleration, rate, -(GRAVITY * np.sin(angle) + acceleration * np.cos(angle)) / LENGTH]

    solved = solve_ivp(rates, (0.0, time[-1]), [0.5, 0, 0, 0], t_eval=time, max_step=0.005, rtol=1e-9)
    cart, _, angle, _ = solved.y
    noise = np.random.default_rng(round(1e3 * period)).normal(0.0, 1.0, (2, len(time)))
    columns = [1e3 * cart + 0.05 * noise[0], np.degrees(angle) + 0.02 * noise[1], 1e3 * set_points]
    lines = ["t,cart,angle,set-point"]
    lines += [",".join(f"{number:.6f}" for number in row) for row in zip(time, *columns, strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return np.array([cart, angle, set_points])


def test_a_planar_map_needs_no_constants(tmp_path: Path) -> None:
    """A run is the same as with constants for all that cannot move."""
    file = tmp_path / "cart.csv"
    cart, angle, _ = measure(file, 0.2, 1.5)
    run, explicit = (
        import_files([file], MeasuredMap.from_table(table, "map"), directory=tmp_path).run
        for table in (MAP, MAP | {"signals": {**CONSTANT, **MAP["signals"]}})
    )
    assert run.table.tobytes() == explicit.table.tobytes()
    state = run.block("state")
    np.testing.assert_allclose(state[:, 0], cart, atol=3e-4)
    np.testing.assert_allclose(state[:, 8], angle, atol=2e-3)
    assert not state[:, [2, 3, 6, 7]].any()
    np.testing.assert_allclose(state[:, 4], LENGTH)


@pytest.mark.parametrize(
    ("rig", "left_out", "missing"),
    [
        ("cart-pendulum", "bridge_position", "bridge_position"),
        ("cart-pendulum", "beta", ""),
        ("cart-pendulum", "bridge_command", "bridge_command"),
        ("lab-rig", "", "trolley_position"),
    ],
)
def test_what_moves_must_be_there(rig: str, left_out: str, missing: str, tmp_path: Path) -> None:
    """Of groups that nobody measured, as angles, nothing is needed."""
    measure(tmp_path / "cart.csv", 0.2, 1.5)
    signals = {name: signal for name, signal in MAP["signals"].items() if name != left_out}
    mapping: dict[str, Any] = {**MAP, "rig": rig, "signals": signals}
    if left_out == "bridge_command":
        mapping["signals"]["rope_command"] = CONSTANT["rope_command"]
    read = MeasuredMap.from_table(mapping, "map")
    if not missing:
        run = import_files([tmp_path / "cart.csv"], read, directory=tmp_path).run
        assert "alpha" not in {name for group in run.groups for name in group.names}
        return
    with pytest.raises(InputError, match=rf"signals\.{missing} is missing"):
        import_files([tmp_path / "cart.csv"], read, directory=tmp_path)


@pytest.mark.usefixtures("in_empty_directory")
def test_commands_identify_and_judge_a_cart(capsys: pytest.CaptureFixture[str]) -> None:
    """The lag of its drive is found within its band, and a run that was not used is covered."""
    for name, (amplitude, period) in {
        "a": (0.2, 1.5),
        "b": (0.1, 0.9),
        "c": (0.3, 2.0),
        "d": (0.15, 1.2),
    }.items():
        measure(Path(f"{name}.csv"), amplitude, period)
    Path("week.toml").write_text(TEXT)
    assert main(["log", "import", "a.csv", "--map", "week.toml", "--out", "a.mcap"]) == 0
    assert main(["compare", "a.mcap"]) == 0
    files = ["a.csv", "b.csv", "c.csv", "--map", "week.toml", "--rig", "cart-pendulum"]
    assert main(["identify", *files, "--out", "mine.toml", "--json", "found.json"]) == 0
    assert RigFile.load("mine.toml").axes == "x"
    found = {row["name"]: row for row in json.loads(Path("found.json").read_text())["estimates"]}
    for number, true in {"bridge_time_constant": LAG, "load_mass": LOAD}.items():
        assert found[number]["value"] == pytest.approx(true, rel=0.01)
    assert main(["validate", "d.csv", "--map", "week.toml", "--rig", "mine.toml", "--tolerance", "5mm"]) == 0
    shown = capsys.readouterr().out
    assert "noise of alpha" not in shown
