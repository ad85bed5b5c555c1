"""Simulate a scenario on a plant, and prepare its parts: plant, controller and tracker."""

from collections.abc import Sequence

from cranectl.controllers import (
    ALL_CONTROLLERS,
    CompiledController,
    Controller,
    LinearController,
    Nominal,
    Tracker,
    compile_controller,
    linearised,
    make_tracker,
)
from cranectl.design import ControllerDesign, Design
from cranectl.plants import DRIVES, REFERENCE_PLANT, Drive, PhysicsStep, Plant, check_scenario, examine
from cranectl.reference import Trajectory
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.simulate.child import BLOCK_TIMEOUT
from cranectl.simulate.loop import Loop, Progress
from cranectl.simulate.memory import check_runs
from cranectl.simulate.plan import Plan, PlannedReference, plan_reference, plan_run
from cranectl.simulate.run import Run
from cranectl.support import Arguments, InputError


@Arguments.checked
def simulate_run(
    scenario: Scenario,
    *,
    plant: str = REFERENCE_PLANT,
    drive: str = "ideal",
    controller: str | None = None,
    design: ControllerDesign | None = None,
    nominal: Scenario | None = None,
    plan: Plan | None = None,
    compiled_controller: CompiledController | None = None,
    compiled: bool = True,
    timeout: float = BLOCK_TIMEOUT,
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
    plan, compiled_controller : Plan, CompiledController, optional
        Results of `plan_scenario` and `prepare_controller`, if they exist already.
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
    nominal = nominal or scenario
    design = design or ALL_CONTROLLERS.design(controller or nominal.controller.name, nominal)
    kind = checked_drive(drive)
    check_runs(scenario, design, kind)
    plan = plan or plan_run(plan_reference(nominal), scenario)
    crane = make_plant(plant, scenario, kind)
    compiled_controller = compiled_controller or prepare_controller(nominal, design, crane.drive, plan)
    loop = Loop(scenario, crane, compiled_controller, plan, design=design, nominal=nominal, compiled=compiled)
    return loop.run(timeout=timeout, progress=progress)


def tracker_of(scenario: Scenario, design: Design) -> Tracker:
    """Return the tracker of `design` in `scenario`; raise InputError if the sampled loop is unstable."""
    return make_tracker(design, period=scenario.period_ns / NANOSECONDS, gravity=scenario.rig.gravity)


def prepare_controller(
    nominal: Scenario, design: ControllerDesign, drive: Drive, plan: PlannedReference
) -> CompiledController:
    """Prepare `design` for the reference of `plan` on the crane `nominal` that it assumes.

    Raises InputError if the sampled loop is unstable, or as the controller's own preparation does.
    """
    controller = ALL_CONTROLLERS.of_design(design)
    recorded = sum(map(len, design.groups))
    return compile_controller(controller, nominal_crane(nominal, design, controller, drive, plan), recorded)


def linearised_controller(
    nominal: Scenario, design: ControllerDesign, rope_lengths: Sequence[float] = ()
) -> list[LinearController]:
    """Return the controller linearised near rest at some rope lengths [m]; empty if it has no linear form.

    The default lengths are the shortest, the middle and the longest rope of the rig.
    """
    controller = ALL_CONTROLLERS.of_design(design)
    if controller.linearise is None:
        return []
    known = nominal_crane(nominal, design, controller, "ideal", plan_reference(nominal))
    shortest, longest = nominal.rig.rope_range
    lengths = rope_lengths or (shortest, 0.5 * (shortest + longest), longest)
    return [linearised(controller, known, length) for length in lengths]


def nominal_crane(
    nominal: Scenario, design: ControllerDesign, controller: Controller, drive: Drive, plan: PlannedReference
) -> Nominal:
    """Return the data of crane, drives and reference with which `controller` is prepared."""
    reference = plan.reference
    if controller.follows == "set-point":
        reference = Trajectory.of(nominal.reference).set_points(plan.time_ns / NANOSECONDS)
    return Nominal(
        rig=nominal.limited_rig,
        drive=drive,
        period=controller.every * nominal.period_ns / NANOSECONDS,
        reference=reference,
        state=plan.reference_state[0],
        parameters=design.parameters,
        axis_design=design.axis_design,
    )


def make_plant(name: str, scenario: Scenario, drive: Drive) -> Plant:
    """Make the plant `name` for a scenario; raise InputError if it is unknown or cannot show the scenario."""
    entry = examine(name, scenario.rig)
    check_scenario(scenario, plant=entry.name, drive=drive)
    if not entry.is_own:
        from cranectl.plants import check_honest

        check_honest(entry.name, drive)
    steps = PhysicsStep(scenario, drive).per_period
    return entry.load()(
        scenario.rig,
        drive=drive,
        step=scenario.period_ns / NANOSECONDS / steps,
        substeps=steps,
        effects=scenario.effects_on_plant,
    )


def checked_drive(name: str) -> Drive:
    """Return `name` as a kind of drive; raise InputError for an unknown name."""
    for drive in DRIVES:
        if drive == name:
            return drive
    raise InputError.unknown("drive", name, DRIVES)
