"""Every controller of the package in C gives the bits of the compiled step, at each of 25 001 samples."""

import math
from pathlib import Path

import numpy as np
import pytest

from cranectl.controllers.registry import controller_names
from cranectl.loaders.opening import open_controller
from cranectl.simulate import Run, simulate_run
from cranectl.tools.export.vectors import replay
from tests.tools.export.exported import (
    COMPILERS,
    address_in,
    as_bits,
    export,
    library,
    prepared,
    replayed,
    same_bits,
)

# All others of the flat family have the step of one of these, and as many numbers.
STEPS = ("lqr", "lqr+loop-shaping", "pid", "lqr-integral", "flat-velocity", "lqr-offset-free")
OPTIONS = ("-O0", "-O2", "-O3")
EQUAL = "0 of 3000 commands differ in a bit, by at most 0; 0 statuses differ"
SANITISERS = "-g -fsanitize=address,undefined -fno-sanitize-recover=all"


@pytest.mark.parametrize("name", controller_names())
def test_no_bit_differs_over_a_whole_run(name: str, tmp_path: Path) -> None:
    """Memory, commands and statuses are equal, and so is every signal of the closed loop."""
    exported = prepared(name)
    path = library(tmp_path, export(tmp_path, exported))
    assert len(exported.inputs) == 25001
    assert same_bits(exported, path)

    run = exported.run
    again = simulate_run(run.scenario, drive=run.drive, controller=open_controller(str(path)))
    expected, columns = columns_of(run), columns_of(again)
    assert expected.keys() == columns.keys()
    assert all(expected[key].tobytes() == columns[key].tobytes() for key in expected)


def columns_of(run: Run) -> dict[tuple[str, int], np.ndarray]:
    """Return the columns of a run; plant and controller both have a signal load_x, so its number matters."""
    columns: dict[tuple[str, int], np.ndarray] = {}
    for name, column in zip((n for group in run.groups for n in group.names), run.table.T, strict=True):
        columns[name, sum(known == name for known, _ in columns)] = column.copy()
    return columns


@pytest.mark.parametrize("name", STEPS)
def test_no_bit_differs_with_other_options_or_compilers(name: str, tmp_path: Path) -> None:
    stem = export(tmp_path, prepared(name))
    ways = [(compiler, options) for compiler in COMPILERS for options in OPTIONS]
    for compiler, options in [*ways, (COMPILERS[0], SANITISERS)]:
        assert replayed(tmp_path, stem, compiler, options) == f"1000 samples: {EQUAL}\n"


@pytest.mark.parametrize("name", STEPS)
def test_no_bit_differs_far_from_any_motion(name: str, tmp_path: Path) -> None:
    """Random inputs reach each way out of a step: slack rope, singular angle, not finite."""
    exported = prepared(name)
    path = library(tmp_path, export(tmp_path, exported))
    sample = exported.sample
    random = np.random.default_rng(1)
    rows = []
    for _ in range(2000):
        measured = random.normal(0.5, 1.0, sample.measured)
        reference = random.normal(0.0, 3.0, 15 * (1 + exported.controller.preview))
        reference[2::15] = random.normal(-0.7, 0.5)
        if random.random() < 0.1:
            measured[random.integers(sample.measured)] = random.choice(
                [math.nan, math.inf, -math.inf, 0.0, -0.0, 1e300]
            )
        rows.append((measured, reference))
    statuses = set()
    for row in rows:  # each from the start, or one number that is not finite would be in all later memories
        ours, theirs = (
            [as_bits(each) for each in replay(address, sample.parameters, sample.memory, [row, row])]
            for address in (sample.address, address_in(path, f"{exported.symbol}_sample"))
        )
        assert ours == theirs
        statuses |= {status for _, _, status in ours}
    assert len(statuses) > 1


def test_the_replay_notices_a_changed_operator(tmp_path: Path) -> None:
    """The comparison fails if it must."""
    stem = export(tmp_path, prepared("lqr"))
    source = tmp_path / f"{stem}.c"
    text = source.read_text(encoding="utf-8")
    changed = text.replace("const double p_x = tan_b * secant;", "const double p_x = tan_b / secant;")
    assert changed != text
    source.write_text(changed, encoding="utf-8")
    with pytest.raises(AssertionError):
        replayed(tmp_path, stem, COMPILERS[0], "-O2")
