"""FMI 3 in closed loop: units of controller and plant, coupled by FMPy, give the numbers of a run.

FMPy knows nothing of cranectl. Each unit has its own library, so that no memory is shared. With ideal and
velocity drives the loop gives the bits of the log. With force drives the run turns commanded forces into
accelerations and these into forces, which differ by their rounding.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import Plan, Run, simulate_run
from cranectl.support.arrays import Array
from cranectl.tools.export.controller_fmu import controller_fmu
from cranectl.tools.export.fmu import fmu_archive
from cranectl.tools.export.plant import DRIVEN, plant_model
from cranectl.tools.export.prepared import prepare_export
from tests.tools.export.fmus import Instance

COMMANDS = [f"command.{axis}" for axis in DRIVEN]
STATES = [f"state.{name}" for name in SignalGroup.STATE.names]
LOADS = [f"load.{name}" for name in SignalGroup.LOAD.names[:6]]
REFERENCES = [f"reference.{name}" for name in SignalGroup.REFERENCE.names]
SHORT = ["duration=4", "disturbances=[]"]
ROUNDING = 1e-12  # [m, rad, m/s, rad/s] of force drives, see above


class Loop(NamedTuple):
    """Plant, drive, controller and further settings of a closed loop."""

    plant: str
    drive: str
    controller: str
    settings: tuple[str, ...] = ()
    name: str = "fast-diagonal"

    @property
    def scenario(self) -> Scenario:
        return load_scenario(self.name, overrides=[*SHORT, *self.settings])

    def run(self, controller: str = "") -> Run:
        name = controller or self.controller
        return simulate_run(self.scenario, plant=self.plant, drive=self.drive, controller=name)


LOOPS = [
    Loop("analytic", "ideal", "pole-placement+hinf"),
    Loop("analytic", "velocity", "flat-velocity"),
    Loop("analytic", "velocity", "lqr", ("effects.limits={force=[1e9, 1e9, 1e9]}",)),
    Loop("analytic", "force", "lqr-integral"),
    Loop("elastic", "velocity", "lqr+loop-shaping", ("effects.rope={}", "effects.body={}")),
    Loop("elastic", "force", "lqr-offset-free", ("effects.frame={}", "rig.trolley_motor_mass=4")),
    Loop("analytic", "velocity", "lqr-integral", (), "cart-transfer"),
    Loop("analytic", "force", "lqr", ("rig.rope='hoisted'", "rig.trolley_motor_mass=4"), "cart-transfer"),
]
IDS = [f"{loop.plant}, {loop.drive}, {loop.controller}, {loop.name}" for loop in LOOPS]


def write_controller(loop: Loop, folder: Path) -> Path:
    """Write the unit of a loop's controller, and the table beside it."""
    content = controller_fmu(prepare_export(loop.scenario, loop.controller, loop.drive), 3)
    path = folder / "controller.fmu"
    path.write_bytes(content.archive)
    path.with_suffix(".toml").write_text(content.table, encoding="utf-8")
    return path


def coupled(loop: Loop, folder: Path, *, changed: float = 1.0) -> Array:
    """Return states and loads (N, 16) of both units in FMPy; `changed` scales each command on its way."""
    scenario = loop.scenario
    crane_file = folder / "crane.fmu"
    crane_file.write_bytes(fmu_archive(plant_model(scenario, loop.plant, loop.drive), 3))
    controller = Instance(write_controller(loop, folder), folder / "controller")
    crane = Instance(crane_file, folder / "crane")
    assert [controller.is_second, crane.is_second] == [False, False]
    period, seen = scenario.period_ns * 1e-9, []
    for row in Plan.of(scenario).reference:
        seen.append(crane.get([*STATES, *LOADS]))
        controller.set(dict(zip(STATES, seen[-1], strict=False)))
        controller.set(dict(zip(REFERENCES, row, strict=True)))
        controller.step(period)
        command = [changed * value for value in controller.get(COMMANDS)]
        crane.set(dict(zip(COMMANDS, command, strict=True)))
        crane.step(period)
    controller.close()
    crane.close()
    return np.array(seen)


def logged(run: Run) -> Array:
    return np.hstack([run.block("state"), run.block("load")[:, :6]])


@pytest.mark.parametrize("loop", LOOPS, ids=IDS)
def test_units_of_controller_and_plant_give_the_numbers_of_the_run(loop: Loop, tmp_path: Path) -> None:
    expected, seen = logged(loop.run()), coupled(loop, tmp_path)
    assert len(expected) == 4001
    if loop.drive == "force":
        np.testing.assert_allclose(seen, expected, rtol=0.0, atol=ROUNDING)
    else:
        assert seen.tobytes() == expected.tobytes()


def test_the_comparison_notices_a_command_that_differs_by_rounding(tmp_path: Path) -> None:
    loop = LOOPS[0]
    assert coupled(loop, tmp_path, changed=1.0 + 2e-16).tobytes() != logged(loop.run()).tobytes()


@pytest.mark.parametrize("plant", ["elastic", "mujoco"])
@pytest.mark.parametrize("loop", LOOPS[:4], ids=IDS[:4])
def test_a_unit_that_cranectl_imports_gives_the_numbers_of_its_controller(
    loop: Loop, plant: str, tmp_path: Path
) -> None:
    """The unit was written for another plant, since a controller does not know what it runs on."""
    other = loop._replace(plant=plant)
    expected = logged(other.run())
    try:
        seen = logged(other.run(open_controller(str(write_controller(loop, tmp_path)))))
    finally:
        close_controllers()
    if loop.drive == "force":
        np.testing.assert_allclose(seen, expected, rtol=0.0, atol=ROUNDING)
    else:
        assert seen.tobytes() == expected.tobytes()
