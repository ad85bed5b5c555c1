"""Provide a benchmark with a scenario of one second, two controllers and few cranes."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.loaders.opening import close_controllers
from cranectl.tools.benchmark.settings import Benchmark
from tests.reference.recordings import scenario_text
from tests.tools.benchmark.tiny import STEP

SMALL = """
name = "small"
seed = 3
laws = ["lqr-integral", "servo.py:SERVO"]
baseline = "lqr-integral"
second_plant = "analytic"
second_share = 0.34

[scenarios.short]
file = "short.toml"
suits = ["path", "set-point"]

[scenarios.path]
file = "short.toml"
suits = ["path"]
set = ["duration=0.8"]
uncertain.rig.load_mass = {distribution = "uniform", low = 0.9, high = 1.1}

[sets.nominal]
spread = 0.0
draws = 2

[sets.wide]
spread = 2.0
draws = 6
uncertain."effects.delay.seconds" = {distribution = "fixed", value = 0.01}

[radius]
scenario = "short"
spreads = [1.0, 3.0]
draws = 4

[singles]
scenario = "short"
spread = 3.0
draws = 3

[singles.effects]
load = ["rig.load_mass"]
sensing = ["effects.sensing"]

[tuning]
scenarios = ["short"]
draws = 2
seed = 5
runs = 40
variation_price = 0.02
validation = { draws = 1, seed = 6 }

[uncertain.rig.load_mass]
distribution = "log-uniform"
low = 0.5
high = 2.0
relative = true

[uncertain.effects.delay.seconds]
distribution = "log-uniform"
low = 0.002
high = 0.008

[uncertain.effects.sensing.seed]
distribution = "integers"
"""

SHORT = scenario_text(
    "kind = 'line'\nto = [0.6, 0.55, -0.8]\nduration = 0.6", [0.5, 0.5, -0.8],
    name="short", duration=1.0, limits={"final_error_m": 0.05},
)  # fmt: skip

SERVO = f'''
"""A spring and a damper on each drive."""

{STEP}

def prepare(nominal):
    stiffness = nominal.parameters["stiffness"] * nominal.rig.gravity
    return np.array([stiffness, nominal.parameters["damping"]]), np.zeros(1)


SERVO = Controller(
    name="servo",
    title="a spring and a damper on each drive",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    follows="set-point",
    parameters=(
        Parameter("stiffness", 0.4, "", "of the spring over g", 0.0, 1e3, search=(0.1, 10.0)),
        Parameter("damping", 4.0, "1/s", "damper", 0.0, 1e3, search=(1.0, 40.0), length_power=-0.5),
    ),
)
'''


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Write a small benchmark with its controller and scenario, enter its folder, and return its file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "servo.py").write_text(SERVO)
    (tmp_path / "small.toml").write_text(SMALL)
    yield tmp_path / "small.toml"
    close_controllers()


@pytest.fixture
def benchmark(small: Path) -> Benchmark:
    """Return the small benchmark."""
    return Benchmark.read(str(small))
