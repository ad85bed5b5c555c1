"""The files of an exported controller: C, header, test vectors with a program, README, and a library."""

import json
import re
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

import numpy as np

from cranectl.controllers.addressed import bind_address
from cranectl.controllers.controller import Controller
from cranectl.controllers.registry import controller_design, controller_of
from cranectl.design import ControllerDesign
from cranectl.export.unit import Unit
from cranectl.export.values import literal
from cranectl.export.vectors import Sample, inputs_of, record_blocks, replay
from cranectl.plants.plant import Drive
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import ERROR, FLAT_OUTPUT, Signal
from cranectl.simulate import plan_scenario, prepare_controller, simulate_run
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

TEMPLATES = Path(__file__).parent / "templates"
FILES = {  # by template
    "NAME.h.txt": "{}.h",
    "main.c.txt": "main.c",
    "cranectl_NAME.c.txt": "cranectl_{}.c",
    "README.md.txt": "README.md",
}
INCLUDED = "#include <math.h>\n#include <stdbool.h>\n#include <stdint.h>\n"
COMMANDED = {"acceleration": "accelerations [m/s²]", "velocity": "velocities [m/s]", "force": "forces [N]"}
MEASURED = {
    "state": "position, rate of bridge, trolley, rope, alpha, beta [m, rad], and two estimated disturbances",
    "encoders": "positions of bridge, trolley, rope, alpha, beta [m, rad]",
}
FOLLOWED = {"path": "path of the load", "set-point": "where the present motion ends"}
LOOPED = 6  # numbers of load and error that the loop records of every controller
NUMBERS_PER_LINE = 5


def exported_files(scenario: Scenario, name: str) -> dict[str, str]:
    """Return the texts of an exported controller by the names of their files.

    Parameters
    ----------
    scenario : Scenario
        The crane, the controller's settings, and the run from which test vectors are taken.
    name : str
        A controller.

    Returns
    -------
    dict
        Text by name of the file.

    Raises
    ------
    InputError
        If the controller is not in Python that Numba compiles, uses what the translation does not know, or
        cannot be prepared for the scenario.
    """
    design = controller_design(name, scenario)
    controller = controller_of(design)
    if controller.entry is not None:
        raise InputError(
            f"the step of {name} is not in Python that Numba compiles",
            allowed="a controller of cranectl, or one in Python whose step Numba compiles",
            remedy="write the step with numbers, loops and functions of math, or use its own source in C",
        )
    symbol = re.sub(r"\W+", "_", f"cranectl_{design.name}")
    text = Unit().step(controller.step, f"{symbol}_step")
    drive: Drive = "ideal" if controller.command == "acceleration" else controller.command
    plan = plan_scenario(scenario)
    compiled = prepare_controller(scenario, design, drive, plan)
    run = simulate_run(scenario, drive=drive, design=design, plan=plan, compiled_controller=compiled)
    inputs = inputs_of(run, compiled, controller.preview)
    if not inputs:
        raise InputError(
            f"the run of {name} in {scenario.name} ends before its first sample: {run.status.label}",
            allowed="a run of one sample or more, for test vectors",
            remedy="correct the controller, or take another scenario",
        )
    blocks = record_blocks(replay(bind_address(compiled).address, compiled, inputs), len(inputs))
    values = {
        **_values(controller, design, scenario),
        "SYMBOL": symbol,
        "GUARD": symbol.upper(),
        "DRIVE": drive,
        "PARAMETERS": str(len(compiled.parameters)),
        "MEMORY": str(len(compiled.start)),
        "REFERENCE": str(len(inputs[0][1])),
        "VECTORS": str(sum(map(len, blocks))),
        **_signals(_logged(controller, design, len(compiled.start))),
    }
    file = values["FILE"]
    texts = {
        pattern.format(file): _filled((TEMPLATES / template).read_text(encoding="utf-8"), values)
        for template, pattern in FILES.items()
    }
    constants = [
        _array(f"{symbol}_parameters[{len(compiled.parameters)}]", compiled.parameters),
        _array(f"{symbol}_initial_memory[{len(compiled.start)}]", compiled.start),
    ]
    texts[f"{file}.c"] = "\n".join([f'{INCLUDED}\n#include "{file}.h"\n', *constants, text])
    texts["vectors.h"] = _vectors_text(blocks)
    return texts


def _values(controller: Controller, design: ControllerDesign, scenario: Scenario) -> dict[str, str]:
    """Return what templates say of a controller, by key."""
    stem = re.sub(r"\W+", "_", design.name)
    kinds = {key: f"CRANECTL_{getattr(controller, key.lower()).upper().replace('-', '_')}"
             for key in ("COMMAND", "FOLLOWS", "MEASURES")}  # fmt: skip
    title = controller.title if design.axis_design is None else f"{design.name} of the flat family"
    return {
        "NAME": design.name,
        "FILE": stem,
        "SLUG": stem.replace("_", "-") + "-c",
        "TITLE": title.replace("*/", "* /"),
        "TITLE_STRING": _string(title),
        "VERSION": version("cranectl"),
        "SCENARIO": scenario.name,
        "PERIOD": repr(controller.every * scenario.period_ns / NANOSECONDS),
        "EVERY": str(controller.every),
        "PREVIEW": str(controller.preview),
        "ROWS": f"{1 + controller.preview} row{'s' if controller.preview else ''}",
        "COMMAND": COMMANDED[controller.command],
        "MEASURED": MEASURED[controller.measures],
        "FOLLOWED": FOLLOWED[controller.follows],
        **{f"{key}_KIND": kind for key, kind in kinds.items()},
    }


def _logged(controller: Controller, design: ControllerDesign, memory: int) -> list[tuple[int, Signal]]:
    """Return places in the memory of the signals that a run records, besides those that the loop computes."""
    if not controller.records_all:
        return list(controller.logged)
    signals = [signal for group in design.groups for signal in group.signals]
    known = {*FLAT_OUTPUT.names[:LOOPED], *ERROR.names[:LOOPED]}
    first = memory - len(signals)
    return [(first + k, signal) for k, signal in enumerate(signals) if signal.name not in known]


def _signals(logged: Iterable[tuple[int, Signal]]) -> dict[str, str]:
    """Return the table of logged signals for the template of the library."""
    rows = [
        f"    {{{', '.join(map(_string, (signal.name, signal.unit, signal.description)))}, {place}}},"
        for place, signal in logged
    ]
    table = ["static const cranectl_signal signals[] = {", *rows, "};", ""]
    return {
        "SIGNALS": "\n".join(["", *table]) if rows else "",
        "SIGNAL_COUNT": str(len(rows)),
        "SIGNAL_TABLE": "signals" if rows else "0",
    }


def _string(text: str) -> str:
    """Return a text as a string of C."""
    return json.dumps(text, ensure_ascii=False)


def _filled(template: str, values: dict[str, str]) -> str:
    return re.sub(r"@(\w+?)@", lambda match: values[match[1]], template)


def _array(name: str, numbers: Array) -> str:
    """Return the definition of a constant array."""
    texts = _number_texts(numbers)
    lines = [", ".join(texts[k : k + NUMBERS_PER_LINE]) for k in range(0, len(texts), NUMBERS_PER_LINE)]
    return f"const double {name} = {{\n    " + ",\n    ".join(lines) + "};\n"


def _number_texts(numbers: Array) -> list[str]:
    """Return the initialisers of an array; zeros at its end are left out."""
    count = int(np.flatnonzero((numbers != 0.0) | np.signbit(numbers)).max(initial=0)) + 1
    return [literal(number)[0] for number in numbers[:count].tolist()]


def _vectors_text(blocks: list[list[Sample]]) -> str:
    """Return the header with test vectors."""
    samples = [sample for block in blocks for sample in block]
    tables = {
        "memory": ("BLOCKS", [block[0].before for block in blocks]),
        **{
            key: ("VECTORS", [getattr(sample, key) for sample in samples])
            for key in ("measured", "reference", "command")
        },
    }
    lines = ["/* Samples of a simulated run, and what the compiled step of cranectl returns for them. */",
             "#include <math.h>", "#include <stdint.h>", "", f"#define BLOCKS {len(blocks)}",
             f"#define BLOCK_SIZE {len(blocks[0])}", "#define VECTORS (BLOCKS * BLOCK_SIZE)", ""]  # fmt: skip
    for name, (count, rows) in tables.items():
        lines.append(f"static const double vector_{name}[{count}][{len(rows[0])}] = {{")
        lines += ["    {" + ", ".join(_number_texts(row)) + "}," for row in rows]
        lines += ["};", ""]
    statuses = ", ".join(str(sample.status) for sample in samples)
    return "\n".join([*lines, f"static const int64_t vector_status[VECTORS] = {{{statuses}}};", ""])
