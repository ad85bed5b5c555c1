"""Every shipped controller reads exactly those fields of the nominal crane that it declares."""

import importlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from cranectl.controllers.controller import Controller
from cranectl.controllers.preparation import prepared
from cranectl.controllers.registry import ALL_CONTROLLERS, FLAT_FAMILY, WHERE
from cranectl.planning import load_scenario
from cranectl.plants.plant import Drive
from cranectl.scenario.effects import EffectNumbers
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import PlannedReference
from cranectl.simulate.prepared import nominal_crane
from cranectl.support.arrays import Array
from tests.conftest import ROOT


class WatchedRig:
    """A rig that records which of its fields and effects are read."""

    def __init__(self, rig: RigParameters | EffectNumbers, read: set[str]) -> None:
        self._rig, self.read = rig, read

    def __getattr__(self, name: str) -> Any:
        if name == "axis_masses":  # which controllers declare by the masses that it is made of
            return RigParameters.axis_masses.fget(self)  # type: ignore[attr-defined]
        item = getattr(self._rig, name)
        if isinstance(item, EffectNumbers):
            return WatchedRig(item, self.read)
        self.read.add(name)
        return item


class WatchedPath:
    """A path that records whether more than its first row is read."""

    def __init__(self, path: Array, read: set[str]) -> None:
        self._path, self.read = path, read

    def __getitem__(self, at: Any) -> Any:
        if (at[0] if isinstance(at, tuple) else at) != 0:
            self.read.add("path")
        return self._path[at]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        self.read.add("path")
        return np.array(self._path, dtype=dtype, copy=copy)


def shipped() -> Iterator[Controller]:
    """Yield all controllers of the package and of the benchmark, except those in C."""
    yield from (ALL_CONTROLLERS[name] for name in (*FLAT_FAMILY, *WHERE))
    for file in sorted((ROOT / "validation" / "benchmark").glob("*.py")):
        module = importlib.import_module(f"validation.benchmark.{file.stem}")
        yield from (value for value in vars(module).values() if isinstance(value, Controller))


SHIPPED = {controller.name: controller for controller in shipped()}


def reads_of(controller: Controller, drive: Drive) -> set[str]:
    """Return what `prepare` reads on the crane of a scenario."""
    scenario = load_scenario("fixed-position")
    design = controller.axis_design(scenario.design) if controller.axis_design else controller.designed({})
    known = nominal_crane(scenario, design, controller, drive, PlannedReference.of(scenario))
    read: set[str] = set()
    rig, path = WatchedRig(known.rig, read), WatchedPath(known.reference, read)
    prepared(controller, known._replace(rig=rig, reference=path))  # type: ignore[arg-type]
    return read


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("drive", ["velocity", "force"])
def test_a_controller_reads_what_it_declares(name: str, drive: Drive) -> None:
    assert SHIPPED[name].reads is not None
    assert reads_of(SHIPPED[name], drive) == set(SHIPPED[name].reads)


def test_all_controllers_of_the_benchmark_are_looked_at() -> None:
    assert len(SHIPPED) >= 24
    assert {"lqr-integral", "energy-coupling", "two-degree-of-freedom"} <= set(SHIPPED)
