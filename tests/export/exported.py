"""Exported controllers, and compilers for them."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np

from cranectl.controllers.addressed import CompiledController
from cranectl.controllers.controller import Controller
from cranectl.controllers.registry import controller_design, controller_of
from cranectl.export import exported_files
from cranectl.export.vectors import Sample
from cranectl.loaders.c_controller import HEADER
from cranectl.planning import load_scenario
from cranectl.simulate import Run, plan_scenario, prepare_controller, simulate_run

SCENARIO = "settled-trajectory"  # 25 001 samples
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off")
COMPILERS = tuple(name for name in ("gcc", "clang") if shutil.which(name)) or ("cc",)


def export(folder: Path, name: str, scenario: str = SCENARIO) -> str:
    """Write the exported controller; return the stem of its files."""
    texts = exported_files(load_scenario(scenario), name)
    for file, text in {**texts, HEADER.name: HEADER.read_text(encoding="utf-8")}.items():
        (folder / file).write_text(text, encoding="utf-8")
    return next(file for file in texts if file.endswith(".h") and file != "vectors.h").removesuffix(".h")


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


def prepared(name: str) -> tuple[Controller, CompiledController, Run]:
    """Return a controller as it is exported, and the run of which its vectors are."""
    scenario = load_scenario(SCENARIO)
    design = controller_design(name, scenario)
    controller = controller_of(design)
    drive = "ideal" if controller.command == "acceleration" else controller.command
    plan = plan_scenario(scenario)
    compiled = prepare_controller(scenario, design, drive, plan)
    return (
        controller,
        compiled,
        simulate_run(scenario, drive=drive, design=design, plan=plan, compiled_controller=compiled),
    )


def as_bits(sample: Sample) -> tuple[bytes, bytes, int]:
    """Return the bits of a sample; all NaN count as equal, whose sign and payload IEEE 754 leaves open."""
    before, command = (np.where(np.isnan(x), np.nan, x).tobytes() for x in (sample.before, sample.command))
    return before, command, sample.status
