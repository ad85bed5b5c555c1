"""One control sample does what the loop does around a controller: it estimates, commands and limits."""

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cranectl.status import RunStatus
from cranectl.tools.export.package import exported_files
from cranectl.tools.export.prepared import Exported
from cranectl.tools.export.vectors import replay
from tests.tools.export.exported import COMPILERS, compile_c, export, library, prepared, replayed, same_bits
from tests.tools.export.test_controllers import EQUAL, SANITISERS

SENSING = ["effects.sensing.seed=3", "effects.sensing.position_noise=[1e-4,1e-4,1e-4]"]
LIMITS = [
    "effects.limits.velocity=[0.7,0.7,0.7]",
    "effects.limits.acceleration=[0.9,0.9,0.9]",
    "effects.limits.force=[1e9,1e9,1e9]",
]
RIG = ["effects.delay.seconds=0.004"]
CALIBRATION = ["effects.installation.rope_offset=0.01"]
CASES = {
    "nothing": ("lqr", "ideal", []),
    "acceleration limits": ("lqr+hinf", "velocity", LIMITS),
    "encoders": ("pid", "velocity", [*SENSING, *CALIBRATION]),
    "encoders, limits and delay": ("lqr", "velocity", [*SENSING, *LIMITS, *RIG]),
    "a controller that commands velocities": ("flat-velocity", "velocity", [*SENSING, *LIMITS]),
    "forces": ("lqr", "force", []),
    "forces and encoders": ("lqr-offset-free", "force", SENSING),
    "encoders and ideal drives": ("lqr-integral", "ideal", [*SENSING, *RIG]),
}


def commands(exported: Exported) -> np.ndarray:
    """Return what the control sample commands in a run."""
    sample = exported.sample
    steps = list(replay(sample.address, sample.parameters, sample.memory, exported.inputs))
    assert all(step.status == RunStatus.RUNNING for step in steps)
    return np.array([step.command for step in steps])


@pytest.mark.parametrize(("name", "drive", "overrides"), CASES.values(), ids=CASES)
def test_it_gives_the_bits_of_a_run_also_in_c(
    name: str, drive: str, overrides: list[str], tmp_path: Path
) -> None:
    exported = prepared(name, drive, *overrides)
    run, late = exported.run, exported.scenario.delay_samples
    given = run.block("input")[:, :3] if drive == "ideal" else run.block("input")[:, 3:]
    if run.has("command"):
        given = run.block("command")[:, :3]
    computed = commands(exported)
    assert len(computed) == 25001
    assert computed[: len(computed) - late].tobytes() == given[late:].tobytes()
    assert np.ptp(computed, axis=0).max() > 0.01
    assert not set(LIMITS) <= set(overrides) or run.block("command")[:, 3:].any(), "no limit acts"
    assert same_bits(exported, library(tmp_path, export(tmp_path, exported)))


def test_the_whole_sample_passes_the_sanitisers(tmp_path: Path) -> None:
    stem = export(tmp_path, prepared("lqr", "velocity", *SENSING, *LIMITS, *RIG))
    for compiler, options in [(COMPILERS[-1], "-O3"), (COMPILERS[0], SANITISERS)]:
        assert replayed(tmp_path, stem, compiler, options) == f"1000 samples: {EQUAL}\n"


def test_a_controller_that_looks_ahead_finds_all_its_rows() -> None:
    """After the last sample the table has as many rows as one sample needs."""
    exported = prepared("lqr")
    compiled = exported.prepared.compiled._replace(reference=np.zeros((9, 15)), samples=6)
    ahead = replace(
        exported,
        controller=replace(exported.controller, preview=3),
        prepared=replace(exported.prepared, compiled=compiled),
    )
    text = exported_files(ahead, "")["reference.h"]
    assert "#define cranectl_lqr_ROWS 6\n" in text
    assert "cranectl_lqr_reference_rows[cranectl_lqr_ROWS + 3][15] = {" in text
    assert text.count("    {") == 9


def test_readme_says_what_the_code_has() -> None:
    """A rig has limits and encoders only if the scenario's effects say so."""
    bare, whole = (
        exported_files(prepared("lqr", "velocity", *settings), "") for settings in ([], [*SENSING, *LIMITS])
    )
    assert "- no observer: the scenario has no effects.sensing\n" in bare["README.md"]
    assert "- no limits of these: the scenario has no effects.limits\n" in bare["README.md"]
    assert "- the observer for encoders\n" in whole["README.md"]
    assert "- limits of these\n" in whole["README.md"]
    begins = "- Begin where the scenario begins: bridge position 0.1 m, bridge velocity 0.0014"
    assert begins in bare["README.md"]


def test_fast_math_is_refused_and_cpp_links(tmp_path: Path) -> None:
    stem = export(tmp_path, prepared("lqr"))
    command = [COMPILERS[0], "-ffast-math", "-c", f"{stem}.c"]
    fast = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert fast.returncode != 0
    assert "compile without -ffast-math" in fast.stderr
    header = (tmp_path / f"{stem}.h").read_text(encoding="utf-8")
    opened, closed = header.index('extern "C" {'), header.rindex("\n}\n#endif\n\n#endif")
    assert opened < header.index("cranectl_lqr_sample(") < closed
    (tmp_path / "twice.c").write_text('#include "reference.h"\n#include "reference.h"\n', encoding="utf-8")
    compile_c(tmp_path, "twice.o", "twice.c", options="-c -Wno-unused-const-variable")
