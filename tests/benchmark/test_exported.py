"""The benchmark's controllers in C give the bits of the compiled step, apart from those that are refused."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.loaders.opening import close_controllers
from cranectl.support.errors import InputError
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.settings import Benchmark
from tests.tools.export.exported import export, library, prepared, same_bits

CONTROLLERS = [name for name in Benchmark.read("literature").laws if ".py:" in name]
REFUSED = {"MPPI": "has the type array", "SUPER_TWISTING": "calls, within an expression"}


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    """Close the files that a test has opened."""
    yield
    close_controllers()


@pytest.mark.parametrize("reference", CONTROLLERS)
def test_no_bit_differs_over_a_whole_run(reference: str, tmp_path: Path) -> None:
    (name,) = measured_controllers(Benchmark.read("literature"), [reference])
    reason = REFUSED.get(reference.rpartition(":")[2])
    if reason:
        with pytest.raises(InputError, match=reason):
            export(tmp_path, prepared(name))
        return
    exported = prepared(name)
    assert len(exported.inputs) > 0
    assert same_bits(exported, library(tmp_path, export(tmp_path, exported)))
