"""Write a benchmark that takes seconds, with a file of simple controllers."""

from pathlib import Path

from cranectl.tools.benchmark.settings import Benchmark

TINY = """\
name = "tiny"
seed = 1
laws = ["mine.py:MINE"]
baseline = "lqr-integral"
plant = "analytic"
set = ["duration=2.5"]

[scenarios.move]
file = "move.toml"
suits = ["path"]

[sets.nominal]
spread = 0.0
draws = 1

[radius]
scenario = "move"
spreads = [1.0, 2.0]
draws = 1

[tuning]
scenarios = ["move"]
draws = 2
seed = 7
runs = 40
variation_price = 0.02
validation = { draws = 3, seed = 8 }

[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.5
high = 1.5
"""
MOVE = """\
name = "move"
duration = 3.0
metrics = { settling_tolerance = 0.02 }
limits = { final_error_m = 0.2 }

[reference]
start = [0.8, 0.6, -0.7]
segments = [{ kind = "line", to = [1.1, 0.9, -0.6], duration = 1.0 }]
"""
STEP = """\
import numpy as np
from cranectl import Controller, InputError, Parameter

def step(parameters, measured, reference, memory, command):
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        command[axis] = parameters[0] * (target - measured[2 * axis]) - parameters[1] * measured[2 * axis + 1]
    return 0
"""
CONTROLLERS = f"""\
{STEP}
def prepare(nominal):
    if nominal.parameters["damping"] > 12.0:
        raise InputError("too much damping")
    return np.array([nominal.parameters["stiffness"], -nominal.parameters["damper"]]), np.zeros(1)

MINE = Controller(
    "mine", "a spring and a damper on each drive", step, prepare,
    parameters=(
        Parameter("stiffness", 1.0, "1/s²", "spring", 0.0, 1e4, search=(0.5, 50.0), length_power=-1.0),
        Parameter("damper", -2.0, "1/s", "damper", -1e4, 0.0, search=(0.5, 20.0), length_power=-0.5),
        Parameter("damping", 1.0, "1/s", "refused where large", 0.0, 1e4),
    ),
)
STIFF = Controller("stiff", "without numbers to tune", step, prepare, parameters=(
    Parameter("stiffness", 16.0, "1/s²", "spring"), Parameter("damper", -8.0, "1/s", "damper"),
    Parameter("damping", 1.0, "1/s", "refused where large"),
))
REFUSES = Controller("refuses", "refuses half of its range", step, prepare, parameters=(
    Parameter("stiffness", 16.0, "1/s²", "spring"), Parameter("damper", -8.0, "1/s", "damper"),
    Parameter("damping", 10.0, "1/s", "refused where large", search=(5.0, 20.0)),
))
def hang(parameters, measured, reference, memory, command):
    while parameters[0] > 1.0005:
        command[0] = 0.5 * (command[0] + memory[0])
    command[0] = command[1] = command[2] = 0.0
    return 0

HANGS = Controller("hangs", "never returns if it is stiff", hang, prepare, parameters=MINE.parameters)
POINTS = Controller("points", "follows set-points", step, prepare, follows="set-point",
                    parameters=MINE.parameters)
"""


def write_tiny(directory: Path) -> Benchmark:
    """Write `tiny.toml`, its scenario and its controllers into `directory`, and read it."""
    for name, text in (("tiny.toml", TINY), ("move.toml", MOVE), ("mine.py", CONTROLLERS)):
        (directory / name).write_text(text, encoding="utf-8")
    return Benchmark.read(str(directory / "tiny.toml"))
