"""Files with laws, good and broken, and the runs that tests ask of them."""

import subprocess
from pathlib import Path

from cranectl.cli.main import main
from cranectl.loaders.c_controller import HEADER
from cranectl.log.reader import read_log
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario

SHORT = ["duration=3.2", "disturbances=[]"]
ASKED = [part for text in SHORT for part in ("--set", text)]
CAMPAIGN = """
name = "own"
scenario = "fast-diagonal"
controllers = CONTROLLERS
plants = ["analytic", "mujoco"]
runs = RUNS
set = ["duration=3.2", "disturbances=[]"]
[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.8
high = 1.2
"""
LAW = '''
import numpy as np
from math import sin

def damper(parameters, measured, reference, memory, command):
    """Spring and damper on each drive."""
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        rate = -reference[5] if axis == 2 else reference[3 + axis]
        memory[axis] = target - measured[2 * axis]
        command[axis] = 16.0 * memory[axis]
        command[axis] += 8.0 * (rate - measured[2 * axis + 1])
    return 0

class BridgeServo:
    """The same with parameters and a signal."""

    parameters = {"stiffness": 16.0, "damping": 8.0}
    memory = 3
    logged = {"bridge_error": 0}

    def step(parameters, measured, reference, memory, command):
        for axis in range(3):
            target = -reference[2] if axis == 2 else reference[axis]
            rate = -reference[5] if axis == 2 else reference[3 + axis]
            memory[axis] = target - measured[2 * axis]
            command[axis] = parameters[0] * memory[axis]
            command[axis] += parameters[1] * (rate - measured[2 * axis + 1])
        return 0

def interpreted(parameters, measured, reference, memory, command):
    """The same in what Numba does not know."""
    named = {"error": [t - q for t, q in zip([*reference[:2], -reference[2]], measured[0:6:2])]}
    rates = [*reference[3:5], -reference[5]]
    for axis in range(3):
        memory[axis] = named["error"][axis]
        command[axis] = 16.0 * named["error"][axis]
        command[axis] += 8.0 * (rates[axis] - measured[2 * axis + 1])
    return 0

print("loading")

def talking(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    if memory[0] == 5.0:
        print(f"stepping {memory[0]:g}")
    return 0

class Talking:
    """Talks before and while it runs, compiled."""

    def prepare(nominal):
        print("preparing")
        return np.zeros(1), np.zeros(1)

    def step(parameters, measured, reference, memory, command):
        memory[0] += 1.0
        if memory[0] == 5.0:
            print("stepping", memory[0])
        return 0

def greedy(parameters, measured, reference, memory, command):
    for axis in range(3):
        reference[axis] += 1.0
        parameters[0] += 1.0
        command[axis] = 1e-4 * (reference[axis] + parameters[0])
    return 0
'''
C_LAW = """
#include <fenv.h>
#include <stdio.h>
#include <stdlib.h>
#include "cranectl.h"
static const cranectl_parameter P[] = {
    {"stiffness", "1/s^2", "spring", 16.0, 0.0, 1e4 TUNING}, {"damping", "1/s", "damper", 8.0, 0.0, 1e4}};
static const cranectl_signal S[] = {{"bridge_error", "m", "of the bridge", 0}};
static cranectl_declaration D = {
    .abi = CRANECTL_ABI, .size = sizeof D, .name = "c-servo", .title = "spring and damper in C",
    .command = CRANECTL_ACCELERATION, .every = 1, .memory = 4, .numbers = 3,
    .parameter_count = 2, .signal_count = 1, .parameters = P, .signals = S MORE};
CRANECTL_EXPORT const cranectl_declaration *cranectl_controller(void) { DECLARED return &D; }
int64_t cranectl_prepare(const cranectl_nominal *nominal, double *parameters, double *memory) {
    (void)memory;
    parameters[2] = nominal->READ_MASS;
    return nominal->load_mass > 5.0;
}
static int steps = 0;
static void __attribute__((constructor)) start(void) { LOADED }
int64_t STEP(const double *p, const double *q, const double *r, double *m, double *u) {
    m[3] += 1.0;
    steps++;
    BROKEN
    for (int i = 0; i < 3; i++) {
        double target = i == 2 ? -r[2] : r[i], rate = i == 2 ? -r[5] : r[3 + i];
        m[i] = target - q[2 * i];
        u[i] = p[0] * m[i];
        u[i] += p[1] * (rate - q[2 * i + 1]);
    }
    return 0;
}
"""


def built(folder: Path, **replaced: str) -> Path:
    """Return a library in whose source words in capitals are replaced.

    `broken` in its step, `tuning` after the bounds of its stiffness, run when `loaded`; `more` ends its
    declaration. It is prepared with the rig's `read_mass`.
    """
    usual = dict.fromkeys(("declared", "broken", "tuning", "loaded", "more"), "") | {"read_mass": "load_mass"}
    text = C_LAW
    for name, part in (usual | {"step": "cranectl_step"} | replaced).items():
        text = text.replace(name.upper(), part)
    source, library = folder / "law.c", folder / f"law-{abs(hash(text))}.so"
    source.write_text(text)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wno-missing-field-initializers", "-shared", "-fPIC"]
    flags += ["-ffp-contract=off", f"-I{HEADER.parent}"]
    subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
    return library


def campaign_file(*controllers: str, runs: int = 4) -> None:
    """Write the campaign `own.toml` into the working directory."""
    text = CAMPAIGN.replace("CONTROLLERS", str(list(controllers))).replace("RUNS", str(runs))
    Path("own.toml").write_text(text)


def scenario(*overrides: str) -> Scenario:
    """Return a short scenario without disturbances."""
    return load_scenario("fast-diagonal", overrides=[*SHORT, *overrides])


def samples_before_failure(controller: str, log: Path, *options: str) -> int:
    """Run a controller that fails: with exit code 3, and a closed log of as many samples as are returned."""
    run = ["run", "fast-diagonal", "--controller", controller, "--plants", "analytic", "--every", "1"]
    assert main([*run, *ASKED, *options, "--out", str(log)]) == 3
    (found,) = read_log(log).values()
    assert found.status.label == "controller-failed"
    return len(found.time_ns)
