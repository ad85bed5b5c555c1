"""The files of an exported controller: C, header, test vectors with a program, README, and a library."""

import json
from collections.abc import Iterable, Sequence
from functools import partial
from importlib.metadata import version

import numpy as np

from cranectl.controllers import JOINTS, Controller
from cranectl.design import ControllerDesign
from cranectl.scenario import NANOSECONDS
from cranectl.signals import BRIDGE, ROPE, TROLLEY, Signal, SignalGroup
from cranectl.support import Array, InputError, Quantity
from cranectl.tools.export.fmu import filled
from cranectl.tools.export.prepared import Exported
from cranectl.tools.export.sample import STATE_SIZE
from cranectl.tools.export.single import in_single_precision, measure_single
from cranectl.tools.export.values import literal
from cranectl.tools.export.vectors import Sample, record_blocks, replay

TOLERANCE, SINGLE_TOLERANCE = "1e-11", "1e-4"  # of commands on a target, relative to 1 or to a larger one
INCLUDED = "#include <math.h>\n#include <stdbool.h>\n#include <stdint.h>\n"
CHECKED = """
#if defined __FAST_MATH__ || (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__)
#error "compile without -ffast-math, which removes the checks of numbers that are not finite"
#endif
"""
COMMANDED = {"ideal": "accelerations [m/s²]", "velocity": "velocities [m/s]", "force": "forces [N]"}
MEASURED = {
    JOINTS: "readings of the encoders of bridge, trolley, rope, alpha, beta [m, rad]",
    STATE_SIZE: "position and rate of bridge, trolley, rope, alpha, beta [m, rad, m/s, rad/s]",
}
FOLLOWED = {"path": "path of the load", "set-point": "where the present motion ends"}
MAX_REFERENCE_ROWS = 100_000  # of a reference that is exported
LOOPED = 6  # numbers of load and error that the loop records of every controller
NUMBERS_PER_LINE = 5
_string = partial(json.dumps, ensure_ascii=False)  # a text as a string of C


def exported_files(exported: Exported, command: str, *, single: bool = False) -> dict[str, str]:
    """Return the texts of a controller's C files by the names of these.

    Parameters
    ----------
    exported : Exported
        The controller, from `prepare_export`.
    command : str
        The command line that asks for it, for the README.
    single : bool
        Whether the code computes with floats, in place of doubles. Its loss stands in the README.

    Returns
    -------
    dict
        Text by name of the file.

    Raises
    ------
    InputError
        If the controller uses what the translation does not know, if its reference has more than
        MAX_REFERENCE_ROWS samples, or as `measure_single`.
    """
    sample, sources = exported.sample, controller_sources(exported)
    values = _values(exported) | {"COMMAND_LINE": command}
    if single:
        sources = {name: in_single_precision(text) for name, text in sources.items()}
        measured = measure_single(exported, sources)
        blocks = measured.blocks
        values |= {"LOSS": f"{max(1e3 * measured.loss, 1e-3):.2g} mm", "TOLERANCE": SINGLE_TOLERANCE}
    else:
        steps = replay(sample.address, sample.parameters, sample.memory, exported.inputs)
        blocks = record_blocks(steps, len(exported.inputs))
        values |= {"TOLERANCE": TOLERANCE}
    values |= {"VECTORS": str(sum(map(len, blocks))), "REAL": "float" if single else "double"}
    values["REMARK"] = filled("single.md.txt" if single else "library.md.txt", values)
    written = {
        "README.md": filled("README.md.txt", values),
        "main.c": filled("main.c.txt", values),
        "vectors.h": _vectors_text(blocks),
        "reference.h": _reference_text(exported),
    }
    if single:
        tables = ("vectors.h", "reference.h")
        return {**sources, **written, **{name: in_single_precision(written[name]) for name in tables}}
    return {**sources, **written, f"cranectl_{exported.stem}.c": filled("cranectl_NAME.c.txt", values)}


def controller_sources(exported: Exported) -> dict[str, str]:
    """Return the C file of a controller and its header, by name."""
    symbol, sample, header = exported.symbol, exported.sample, f"{exported.stem}.h"
    constants = [
        _array(f"{symbol}_parameters[{len(sample.parameters)}]", sample.parameters),
        _array(f"{symbol}_initial_memory[{len(sample.memory)}]", sample.memory),
    ]
    parts = [f'{INCLUDED}\n#include "{header}"\n{CHECKED}', *constants, exported.code]
    return {header: filled("NAME.h.txt", _values(exported)), f"{exported.stem}.c": "\n".join(parts)}


def _values(exported: Exported) -> dict[str, str]:
    """Return what templates say of a controller, by key."""
    design, controller, scenario = exported.design, exported.controller, exported.scenario
    kinds = {key: f"CRANECTL_{getattr(controller, key.lower()).upper().replace('-', '_')}"
             for key in ("COMMAND", "FOLLOWS", "MEASURES")}  # fmt: skip
    title = controller.title if design.axis_design is None else f"{design.name} of the flat family"
    period, sample, compiled = scenario.period_ns / NANOSECONDS, exported.sample, exported.prepared.compiled
    return {
        "SYMBOL": exported.symbol,
        "GUARD": exported.symbol.upper(),
        "PARAMETERS": str(len(sample.parameters)),
        "MEMORY": str(len(sample.memory)),
        "FIRST_PARAMETER": str(len(sample.parameters) - len(compiled.parameters)),
        "FIRST_MEMORY": str(len(sample.memory) - len(compiled.start)),
        "REFERENCE": str(len(exported.inputs[0][1])),
        "ROWS_OF_REFERENCE": str(compiled.samples),
        "START": _start(exported),
        "CONTENTS": _contents(exported),
        **_signals(controller, design, len(compiled.start)),
        "NAME": design.name,
        "FILE": exported.stem,
        "SLUG": exported.slug,
        "TITLE": title.replace("*/", "* /"),
        "TITLE_STRING": _string(title),
        "VERSION": version("cranectl"),
        "SCENARIO": scenario.name,
        "DRIVE": exported.drive,
        "PERIOD": repr(period),
        "STEP_PERIOD": repr(controller.every * period),
        "EVERY": str(controller.every),
        "PREVIEW": str(controller.preview),
        "ROWS": f"{1 + controller.preview} row{'s' if controller.preview else ''}",
        "COMMAND": COMMANDED[exported.drive],
        "MEASURED": MEASURED[exported.sample.measured],
        "FOLLOWED": FOLLOWED[controller.follows],
        **{f"{key}_KIND": kind for key, kind in kinds.items()},
    }


def _start(exported: Exported) -> str:
    """Return the state at the start, without angles and rates that are zero."""
    state = zip(SignalGroup.STATE.signals, exported.run.block("state")[0].tolist(), strict=True)
    return ", ".join(
        f"{signal.name.replace('_', ' ')} {value:.6g} {signal.unit}"
        for place, (signal, value) in enumerate(state)
        if value != 0.0 or place in (BRIDGE, TROLLEY, ROPE)
    )


def _contents(exported: Exported) -> str:
    """Return what the code has and lacks, as lines of a list."""
    has_encoders, limits = exported.sample.measured == JOINTS, exported.scenario.effects.limits
    lines = [
        "the observer for encoders" if has_encoders else "no observer: the scenario has no effects.sensing"
    ]
    lines.append(f"the commands of {exported.drive} drives")
    if exported.drive == "velocity":
        lines.append(
            "limits of these" if limits else "no limits of these: the scenario has no effects.limits"
        )
    return "\n".join(f"- {line}" for line in lines)


def _signals(controller: Controller, design: ControllerDesign, memory: int) -> dict[str, str]:
    """Return the table of signals that a run records, besides those of the loop, for the library."""
    logged: Iterable[tuple[int, Signal]] = controller.logged
    if controller.records_all:
        signals = [signal for group in design.groups for signal in group.signals]
        known = {*SignalGroup.FLAT_OUTPUT.names[:LOOPED], *SignalGroup.ERROR.names[:LOOPED]}
        places = enumerate(signals, memory - len(signals))
        logged = [(place, signal) for place, signal in places if signal.name not in known]
    rows = [
        f"    {{{', '.join(map(_string, (signal.name, signal.unit, signal.description)))}, {place}}},"
        for place, signal in logged
    ]
    table = ["", "static const cranectl_signal signals[] = {", *rows, "};", ""]
    return {
        "SIGNALS": "\n".join(table) if rows else "",
        "SIGNAL_COUNT": str(len(rows)),
        "SIGNAL_TABLE": "signals" if rows else "0",
    }


def _array(name: str, numbers: Array) -> str:
    """Return the definition of a constant array."""
    texts = _number_texts(numbers)
    lines = [", ".join(texts[k : k + NUMBERS_PER_LINE]) for k in range(0, len(texts), NUMBERS_PER_LINE)]
    return f"const double {name} = {{\n    " + ",\n    ".join(lines) + "};\n"


def _number_texts(numbers: Array) -> list[str]:
    """Return the initialisers of an array; zeros at its end are left out."""
    count = int(np.flatnonzero((numbers != 0.0) | np.signbit(numbers)).max(initial=0)) + 1
    return [literal(number)[0] for number in numbers[:count].tolist()]


def _reference_text(exported: Exported) -> str:
    """Return the header with the reference at each sample; raise InputError if it is too long for one."""
    rows = exported.prepared.compiled.reference
    if len(rows) > MAX_REFERENCE_ROWS:
        period = exported.scenario.period_ns / NANOSECONDS
        raise InputError(
            f"the reference of {exported.scenario.name} has {len(rows)} samples",
            allowed=f"at most {MAX_REFERENCE_ROWS}, which are {MAX_REFERENCE_ROWS * period:g} s",
            remedy=f"add --set duration={Quantity((MAX_REFERENCE_ROWS // 2) * period).setting()}, "
            "or take a shorter scenario",
        )
    said = f"{FOLLOWED[exported.controller.follows].capitalize()} in the scenario {exported.scenario.name}"
    preview, symbol = exported.controller.preview, exported.symbol
    guard, count = f"{symbol}_REFERENCE_H".upper(), f"{symbol}_ROWS"
    size = f"{count} + {preview}" if preview else count  # the last sample needs as many as the others
    lines = [
        f"/* {said}: x, y, z [m] and four derivatives, at each sample. */",
        f"#ifndef {guard}\n#define {guard}\n\n#include <math.h>\n",
        f"#define {count} {exported.prepared.compiled.samples}\n",
        *_table(f"{symbol}_reference_rows", size, list(rows)),
        "\n#endif",
    ]
    return "\n".join(lines) + "\n"


def _table(name: str, count: str, rows: Sequence[Array]) -> list[str]:
    """Return the lines of the definition of a constant table."""
    texts = ["    {" + ", ".join(_number_texts(row)) + "}," for row in rows]
    return [f"static const double {name}[{count}][{len(rows[0])}] = {{", *texts, "};"]


def _vectors_text(blocks: list[list[Sample]]) -> str:
    """Return the header with test vectors."""
    samples = [sample for block in blocks for sample in block]
    lines = ["/* Samples of a simulated run, and what the compiled functions of cranectl return for them. */",
             "#include <math.h>", "#include <stdint.h>", "", f"#define BLOCKS {len(blocks)}",
             f"#define BLOCK_SIZE {len(blocks[0])}", "#define VECTORS (BLOCKS * BLOCK_SIZE)", ""]  # fmt: skip
    lines += [*_table("vector_memory", "BLOCKS", [block[0].before for block in blocks]), ""]
    for key in ("measured", "reference", "command"):
        lines += [*_table(f"vector_{key}", "VECTORS", [getattr(sample, key) for sample in samples]), ""]
    statuses = ", ".join(str(sample.status) for sample in samples)
    return "\n".join([*lines, f"static const int64_t vector_status[VECTORS] = {{{statuses}}};", ""])
