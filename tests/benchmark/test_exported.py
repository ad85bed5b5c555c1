"""The benchmark's controllers in C give the bits of the compiled step, apart from those that are refused."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.campaign.benchmark.settings import read_benchmark
from cranectl.cli.benchmark import measured_controllers
from cranectl.controllers.addressed import bind_address
from cranectl.export.vectors import inputs_of, replay
from cranectl.loaders.opening import close_controllers
from cranectl.support.errors import InputError
from tests.export.exported import address_in, as_bits, export, library, prepared

CONTROLLERS = [name for name in read_benchmark("literature").laws if ".py:" in name]
REFUSED = {
    "MPPI": "has the type array",
    "SUPER_TWISTING": "calls, within an expression",
}


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    """Close the files that a test has opened."""
    yield
    close_controllers()


@pytest.mark.parametrize("reference", CONTROLLERS)
def test_no_bit_differs_over_a_whole_run(reference: str, tmp_path: Path) -> None:
    (name,) = measured_controllers(read_benchmark("literature"), [reference])
    reason = REFUSED.get(reference.rpartition(":")[2])
    if reason:
        with pytest.raises(InputError, match=reason):
            export(tmp_path, name)
        return
    path = library(tmp_path, export(tmp_path, name))
    controller, compiled, run = prepared(name)
    inputs = inputs_of(run, compiled, controller.preview)
    ours, theirs = (
        replay(address, compiled, inputs) for address in (bind_address(compiled).address, address_in(path))
    )
    assert len(inputs) > 0
    assert all(as_bits(a) == as_bits(b) for a, b in zip(ours, theirs, strict=True))
