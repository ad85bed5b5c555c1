"""Simulate a scenario on a plant."""

from dataclasses import replace

from cranectl.controllers import ALL_CONTROLLERS
from cranectl.design import ControllerDesign
from cranectl.plants import DRIVES, PLANTS
from cranectl.scenario import Scenario
from cranectl.simulate.loop import Loop, Progress
from cranectl.simulate.memory import RunMemory
from cranectl.simulate.plan import Plan, PlannedReference
from cranectl.simulate.prepared import PreparedController
from cranectl.simulate.run import Run
from cranectl.support import Arguments


@Arguments.checked
def simulate_run(
    scenario: Scenario,
    *,
    plant: str = PLANTS.REFERENCE,
    drive: str = "ideal",
    controller: str | None = None,
    design: ControllerDesign | None = None,
    nominal: Scenario | None = None,
    plan: Plan | None = None,
    compiled_controller: PreparedController | None = None,
    compiled: bool = True,
    timeout: float = Loop.TIMEOUT,
    progress: Progress | None = None,
) -> Run:
    """Simulate a scenario on one plant and record every sample.

    A run that stops early, also by Ctrl-C, returns the samples up to there, with the reason in its status.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    plant, drive : str
        Plant, or the path of a model file in MJCF, and kind of drive.
    controller : str, optional
        One of `controller_names()`; by default the scenario's.
    design : ControllerDesign, optional
        A finished design in place of `controller`.
    nominal : Scenario, optional
        The crane that the controller assumes; it may differ in rig, effects, initial state and disturbances.
    plan, compiled_controller : Plan, PreparedController, optional
        Results of `Plan.of` and `PreparedController.of`, if they exist already. The controller brings its
        design and the crane that it assumes.
    compiled : bool
        Whether the compiled loop runs; the one in Python is slower and easy to debug.
    timeout : float
        Time [s] that a block of samples may take with a controller from outside the package.
    progress : Callable, optional
        Called with the simulated seconds since the last call.

    Returns
    -------
    Run
        The run.

    Raises
    ------
    InputError
        If a name is unknown, the rig cannot follow the reference, or the run takes too much memory.
    """
    prepared = compiled_controller
    nominal = prepared.nominal if prepared else nominal or scenario
    design = prepared.design if prepared else design
    design = design or ALL_CONTROLLERS.design(controller or nominal.controller.name, nominal)
    kind = DRIVES.checked(drive)
    RunMemory(scenario).check_runs(design, kind)
    plan = plan or PlannedReference.of(nominal).plan(scenario)
    crane = PLANTS.make(plant, scenario, kind)
    prepared = prepared or PreparedController.of(nominal, design, crane.drive, plan)
    loop = Loop(replace(plan, scenario=scenario), crane, prepared, compiled=compiled)
    return loop.run(timeout=timeout, progress=progress)
