"""Files with laws, good and broken."""

import subprocess
from pathlib import Path

from cranectl.loaders.c_controller import HEADER

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

def raising(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    if memory[0] > 1200:
        raise RuntimeError("no more: " + str({}))
    return 0

class Compiled:
    """Raises in what Numba compiles."""

    def step(parameters, measured, reference, memory, command):
        memory[0] += 1.0
        if memory[0] > 1200:
            raise ValueError("sensor lost", memory[0])
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

def leaving(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    if memory[0] > 1200:
        raise SystemExit(f"{memory[0]:g} samples")
    return 0

def not_a_number(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    command[0] = 0.0 * np.sqrt(1200.0 - memory[0])
    return 0

def endless(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    x = 0.0
    while memory[0] > 1200.0 and x < 1.0:
        x = 0.5 * x
    return 0

def writing(parameters, measured, reference, memory, command):
    reference[0] = len(str({}))
    return 0

def greedy(parameters, measured, reference, memory, command):
    for axis in range(3):
        reference[axis] += 1.0
        parameters[0] += 1.0
        command[axis] = 1e-4 * (reference[axis] + parameters[0])
    return 0

def two(parameters, measured):
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
    parameters[2] = nominal->load_mass;
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


def built(
    folder: Path,
    *,
    declared: str = "",
    broken: str = "",
    step: str = "cranectl_step",
    tuning: str = "",
    loaded: str = "",
    more: str = "",
) -> Path:
    """A library: `broken` in its step, `tuning` after the bounds of its stiffness, run when `loaded`.

    `more` ends its declaration.
    """
    parts = {
        "DECLARED": declared,
        "BROKEN": broken,
        "STEP": step,
        "TUNING": tuning,
        "LOADED": loaded,
        "MORE": more,
    }
    text = C_LAW
    for name, part in parts.items():
        text = text.replace(name, part)
    source, library = folder / "law.c", folder / f"law-{abs(hash(text))}.so"
    source.write_text(text)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wno-missing-field-initializers", "-shared", "-fPIC"]
    flags += ["-ffp-contract=off", f"-I{HEADER.parent}"]
    subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
    return library
