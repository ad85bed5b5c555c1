"""Exported controllers, and compilers for them."""

import ctypes
import shutil
import subprocess
from functools import lru_cache
from pathlib import Path

import numpy as np

from cranectl.loaders.c_controller import HEADER
from cranectl.planning import load_scenario
from cranectl.tools.export.package import exported_files
from cranectl.tools.export.prepared import Exported, prepare_export
from cranectl.tools.export.vectors import Sample, replay

SCENARIO = "settled-trajectory"  # 25 001 samples
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off")
COMPILERS = tuple(name for name in ("gcc", "clang") if shutil.which(name)) or ("cc",)


def export(folder: Path, exported: Exported) -> str:
    """Write the C files of a controller; return the stem of their names."""
    texts = exported_files(exported, "cranectl design …")
    for file, text in {**texts, HEADER.name: HEADER.read_text(encoding="utf-8")}.items():
        (folder / file).write_text(text, encoding="utf-8")
    return exported.stem


def compile_c(
    folder: Path, output: str, *files: str, compiler: str = COMPILERS[0], options: str = "-O2"
) -> Path:
    """Compile files of a folder without a warning; return the result."""
    command = [compiler, *STRICT, *options.split(), "-o", output, *files, "-lm"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return folder / output


def library(folder: Path, stem: str) -> Path:
    """Return the library for cranectl."""
    return compile_c(folder, f"{stem}.so", f"{stem}.c", f"cranectl_{stem}.c", options="-O2 -shared -fPIC")


def address_in(path: Path, name: str = "cranectl_step") -> int:
    """Return the address of a function of a library."""
    return ctypes.cast(getattr(ctypes.CDLL(str(path)), name), ctypes.c_void_p).value or 0


def replayed(folder: Path, stem: str, compiler: str, options: str) -> str:
    """Return what the program that replays the test vectors prints."""
    program = compile_c(folder, "replay", "main.c", f"{stem}.c", compiler=compiler, options=options)
    result = subprocess.run([str(program)], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
    return result.stdout


@lru_cache(maxsize=4)
def prepared(name: str, drive: str | None = None, *overrides: str) -> Exported:
    """Return a controller as it is exported, with the run of which its vectors are."""
    return prepare_export(load_scenario(SCENARIO, overrides=overrides), name, drive)


def same_bits(exported: Exported, library: Path) -> bool:
    """Return True if the control sample of a library does at each sample of the run what ours does."""
    sample = exported.sample
    ours, theirs = (
        replay(address, sample.parameters, sample.memory, exported.inputs)
        for address in (sample.address, address_in(library, f"{exported.symbol}_sample"))
    )
    return all(as_bits(a) == as_bits(b) for a, b in zip(ours, theirs, strict=True))


def as_bits(sample: Sample) -> tuple[bytes, bytes, int]:
    """Return the bits of a sample; all NaN count as equal, whose sign and payload IEEE 754 leaves open."""
    before, command = (np.where(np.isnan(x), np.nan, x).tobytes() for x in (sample.before, sample.command))
    return before, command, sample.status
