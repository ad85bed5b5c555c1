"""A controller with all that its exported files are made from."""

import re
from dataclasses import dataclass
from functools import cached_property

from cranectl.controllers import ALL_CONTROLLERS, Controller
from cranectl.design import ControllerDesign
from cranectl.plants import DRIVES, Drive
from cranectl.scenario import Scenario
from cranectl.simulate import Plan, PreparedController, Run, simulate_run
from cranectl.support import Array, InputError
from cranectl.tools.export.sample import ControlSample, control_sample_of
from cranectl.tools.export.unit import Unit
from cranectl.tools.export.vectors import inputs_of


@dataclass(frozen=True)
class Exported:
    """A controller that is to be exported, with all that its files are made from."""

    run: Run  # of the scenario
    controller: Controller
    prepared: PreparedController
    sample: ControlSample
    inputs: list[tuple[Array, Array]]  # of each control sample of the run

    @property
    def scenario(self) -> Scenario:
        """The scenario that it was prepared for."""
        return self.run.scenario

    @property
    def design(self) -> ControllerDesign:
        """The controller with its settings."""
        return self.run.design

    @property
    def drive(self) -> Drive:
        """Kind of drive that the commands are for."""
        return self.run.drive

    @property
    def symbol(self) -> str:
        """The prefix of names in C."""
        return re.sub(r"\W+", "_", f"cranectl_{self.design.name}")

    @property
    def stem(self) -> str:
        """The name of files, without their endings."""
        return re.sub(r"\W+", "_", self.design.name)

    @property
    def slug(self) -> str:
        """The name under which cranectl runs the exported controller."""
        return f"{self.stem.replace('_', '-')}-c"

    @cached_property
    def code(self) -> str:
        """The C text of sample and step; raises InputError for what has no translation."""
        unit = Unit()
        unit.step(self.controller.step, f"{self.symbol}_step")
        unit.step(self.sample.function, f"{self.symbol}_sample")
        return unit.text()


def prepare_export(scenario: Scenario, name: str, drive: str | None = None) -> Exported:
    """Prepare a controller for a scenario, and simulate it there.

    Parameters
    ----------
    scenario : Scenario
        The crane, the controller's settings, the reference, and the run from which test vectors are taken.
    name : str
        A controller.
    drive : str, optional
        Kind of drive that the commands are for; by default what the controller itself commands.

    Returns
    -------
    Exported
        What the exported files are made from.

    Raises
    ------
    InputError
        If the controller is not in Python that Numba compiles, or cannot be prepared for the scenario.
    """
    design = ALL_CONTROLLERS.design(name, scenario)
    controller = ALL_CONTROLLERS.of_design(design)
    if controller.entry is not None:
        file = controller.origin.reference if controller.origin else name
        is_python = controller.step is not Controller.called_by_address
        raise InputError(
            f"the step of {file} is not in Python that Numba compiles"
            if is_python
            else f"{file} has no Python source to translate: it is a library, an FMU or another program",
            allowed="a controller of cranectl, or one in Python whose step Numba compiles",
            remedy="write the step with numbers, loops and functions of math"
            if is_python
            else "export the Python controller that it was made from, or compile its own source",
        )
    usual = "ideal" if controller.command == "acceleration" else controller.command
    kind = DRIVES.checked(drive or usual)
    plan = Plan.of(scenario)
    prepared = PreparedController.of(scenario, design, kind, plan)
    run = simulate_run(scenario, drive=kind, plan=plan, compiled_controller=prepared)
    sample = control_sample_of(prepared, controller, kind, plan.initial_state)
    inputs = inputs_of(run, sample, prepared, controller.preview)
    if not inputs:
        raise InputError(
            f"the run of {name} in {scenario.name} ends before its first sample: {run.status.label}",
            allowed="a run of one sample or more, for test vectors",
            remedy="correct the controller, or take another scenario",
        )
    return Exported(run, controller, prepared, sample, inputs)
