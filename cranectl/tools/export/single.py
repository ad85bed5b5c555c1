"""A controller in single precision: its C text, its test vectors, and its loss in simulation."""

import ctypes
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from cranectl.controllers import JOINTS
from cranectl.design import ControllerDesign
from cranectl.plants import DRIVES
from cranectl.simulate import simulate_run
from cranectl.support import Array, InputError
from cranectl.tools.export.calls import MATH
from cranectl.tools.export.fmu import compile_library, filled
from cranectl.tools.export.prepared import Exported
from cranectl.tools.export.vectors import Sample, record_blocks, replay

# A comment, a word, or a number with a point or an exponent.
_TOKEN = re.compile(
    r"/\*.*?\*/|[A-Za-z_]\w*|0x[0-9a-f.]+p[-+]?\d+|\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+", re.DOTALL
)
_FUNCTIONS = {*MATH.values(), "pow", "fmax"} - {"isfinite", "isnan", "isinf"}
MAX_LOSS = 0.1  # m, with which an export still makes sense


class SinglePrecision(NamedTuple):
    """What a controller does in single precision."""

    blocks: list[list[Sample]]  # test vectors
    loss: float  # largest distance between the loads of both runs [m]


def in_single_precision(text: str) -> str:
    """Return C text with floats in place of doubles."""

    def replaced(match: re.Match[str]) -> str:
        token = match[0]
        if token == "double":
            return "float"
        if token in _FUNCTIONS or token[0].isdigit():
            return f"{token}f"
        return token

    return _TOKEN.sub(replaced, text)


def measure_single(exported: Exported, sources: Mapping[str, str]) -> SinglePrecision:
    """Run the control sample in single precision; `sources` are its C files.

    Raises InputError without a C compiler, and if the run ends early or the load leaves its path.
    """
    sample, run = exported.sample, exported.run
    with _compiled(exported, sources) as address:
        rounded = [(_rounded(measured), _rounded(reference)) for measured, reference in exported.inputs]
        steps = replay(address, sample.parameters, _rounded(sample.memory), rounded)
        blocks = record_blocks(steps, len(rounded))
        kind = DRIVES[run.drive].command
        # Not a controller of the registry: all that surrounds it in the loop has nothing left to do.
        compiled = exported.prepared.compiled._replace(
            address=address,
            parameters=sample.parameters,
            start=_rounded(sample.memory),
            every=1,
            encoders=sample.measured == JOINTS,
            velocity=kind == "velocity",
            force=kind == "force",
            places=np.zeros(0, dtype=np.int64),
            slack_place=-1,
            records_all=False,
        )
        single = simulate_run(
            run.scenario,
            drive=run.drive,
            compiled_controller=replace(
                exported.prepared, design=ControllerDesign("single-precision"), compiled=compiled
            ),
        )
    rows = min(len(single.table), len(run.table))
    apart = single.block("load")[:rows, :3] - run.block("load")[:rows, :3]
    loss = float(np.linalg.norm(apart, axis=1).max(initial=0.0))
    if len(single.table) < len(run.table) or not loss < MAX_LOSS:
        ended = f"{single.status.label}, the load is up to {loss:.3g} m away"
        raise InputError(
            f"{run.design.name} in single precision: {ended}",
            allowed=f"a controller that keeps the load within {MAX_LOSS:g} m of the run with doubles",
            remedy="export it with doubles, without --real",
        )
    return SinglePrecision(blocks, loss)


def _rounded(numbers: Array) -> Array:
    """Return the nearest numbers of single precision."""
    return numbers.astype(np.float32).astype(np.float64)


@contextmanager
def _compiled(exported: Exported, sources: Mapping[str, str]) -> Iterator[int]:
    """Yield the address of the sample in single precision, with arguments of doubles."""
    values = {
        "STEM": exported.stem,
        "SYMBOL": exported.symbol,
        "MEASURED": exported.sample.measured,
        "REFERENCE": len(exported.inputs[0][1]),
        "MEMORY": len(exported.sample.memory),
    }
    content = compile_library("single", {**sources, "adapter.c": filled("adapter.c.txt", values)})
    with TemporaryDirectory(prefix="cranectl-single-") as directory:
        path = Path(directory, "single.so")
        path.write_bytes(content)
        yield ctypes.cast(ctypes.CDLL(str(path)).adapter, ctypes.c_void_p).value or 0
