"""Simulate a scenario on a plant, as a whole run in memory or as a stream of blocks."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
from cranectl.reference import build_trajectory
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import COLUMN, PATH
from cranectl.simulate.actuation import initial_integral, make_actuation, make_unloaded_drives
from cranectl.simulate.child import BLOCK_TIMEOUT, CAN_FORK, blocks_here, blocks_in_child, shared_zeros
from cranectl.simulate.loops import AdvanceBlock, LoopInputs, compiled_loop, python_loop
from cranectl.simulate.memory import check_runs
from cranectl.simulate.plan import Plan, PlannedReference, plan_reference, plan_run
from cranectl.simulate.run import Run, record_width
from cranectl.simulate.signal_path import SignalPath, make_signal_path, whole_record
from cranectl.status import RunStatus
from cranectl.support import Array, InputError, checks_arguments, renamed_arguments

Progress = Callable[[float], None]  # called with the simulated seconds since the last call

BLOCK = 1000  # samples per call of the loop: a few milliseconds of computing


class PreparedRun(NamedTuple):
    """A run that is ready for its first sample."""

    advance: AdvanceBlock
    inputs: LoopInputs
    path: SignalPath | None
    memory: Array


@renamed_arguments(known="nominal", law="compiled_controller", patience="timeout")
@checks_arguments
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
    samples, width = len(plan.time_ns), record_width(design)
    outside = ALL_CONTROLLERS.of_design(design) if design.origin and compiled and CAN_FORK else None
    zeros = np.zeros if outside is None else shared_zeros
    path_record = None if outside is None else shared_zeros((samples, PATH.width))
    run = start_run(
        crane,
        scenario,
        compiled_controller,
        plan,
        nominal=nominal,
        path_record=path_record,
        compiled=compiled,
        bind=outside is None,
    )
    record = zeros((samples, width))
    rows, last, status = _run_blocks(run, record, plan, outside, timeout=timeout, progress=progress)
    return Run(
        scenario=scenario,
        design=design,
        plant=crane.name,
        drive=crane.drive,
        model=crane.description,
        time_ns=plan.time_ns[:rows],
        table=whole_record(scenario, record, run.path, plan.wind)[:rows],
        reference=plan.reference[:rows],
        status=status,
        end_ns=int(plan.time_ns[last]),
    )


def start_run(
    crane: Plant,
    scenario: Scenario,
    controller: CompiledController,
    plan: Plan,
    *,
    nominal: Scenario,
    path_record: Array | None = None,
    compiled: bool = True,
    bind: bool = True,
) -> PreparedRun:
    """Put `crane`, the plant of `scenario`, at the start of `plan`, and return the run.

    `bind` gives a controller from outside an address in this process, which it needs to run here. The signal
    path writes to `path_record`, by default a new array for all samples. Raises InputError if effects or
    steps do not allow the shortest rope of the plan.
    """
    crane.check_length(plan.shortest_rope)
    start = plan.initial_state
    crane.reset(start)
    samples = len(plan.time_ns)
    return PreparedRun(
        advance=compiled_loop(crane) if compiled else python_loop(crane),
        inputs=inputs_of(scenario, controller, plan, crane.drive, nominal=nominal, bind=bind),
        path=make_signal_path(
            scenario, start, drive=crane.drive, samples=samples, nominal=nominal, record=path_record
        ),
        memory=controller.start.copy(),
    )


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
        reference = build_trajectory(nominal.reference).set_points(plan.time_ns / NANOSECONDS)
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


def inputs_of(
    scenario: Scenario,
    controller: CompiledController,
    plan: Plan,
    drive: Drive,
    *,
    nominal: Scenario,
    bind: bool = True,
) -> LoopInputs:
    """Return what a loop needs to run `plan` from its first row to its last.

    `nominal` and `bind` are as in `start_run`.
    """
    controller = controller.with_own_memory()
    return LoopInputs(
        controller=controller.bound() if bind else controller,
        actuation=make_actuation(nominal, drive),
        integral=initial_integral(plan.initial_state),
        unloaded=make_unloaded_drives(nominal, drive, plan.initial_state),
        reference=plan.reference,
        disturbance=plan.disturbance,
        wind=plan.wind,
        workspace=scenario.reach,
        stop_outside=scenario.workspace.on_exit == "stop",
        command_column=COLUMN.input + (DRIVES[drive].column or 0),
        recover=scenario.effects.rope is not None and scenario.effects.rope.on_slack == "recover",
        slack=np.zeros(1),
    )


def _run_blocks(
    run: PreparedRun,
    record: Array,
    plan: Plan,
    outside: Controller | None,
    *,
    timeout: float,
    progress: Progress | None,
) -> tuple[int, int, RunStatus]:
    """Run all blocks; return (complete rows, index of the last sample, status)."""
    rows, status, total, inputs = 0, RunStatus.RUNNING, len(plan.time_ns), run.inputs

    def advance(first: int) -> tuple[int, int, int]:
        nonlocal inputs
        inputs = inputs._replace(controller=inputs.controller.bound())
        return run.advance(inputs, run.path, record, run.memory, first, min(first + BLOCK, total))

    try:
        if outside is None:
            blocks = blocks_here(advance, total)
        else:
            run.advance(
                run.inputs, run.path, record, run.memory, 0, 0
            )  # compile before the time limit counts
            blocks = blocks_in_child(advance, total, outside.name, timeout)
        for complete, ended_at, code in blocks:
            done, rows, end, status = rows, complete, ended_at, RunStatus(code)
            if progress is not None:
                progress((rows - done) * run.inputs.actuation.period)
    except KeyboardInterrupt:
        return rows, max(rows - 1, 0), RunStatus.INTERRUPTED
    if status == RunStatus.RUNNING:
        return rows, rows - 1, RunStatus.COMPLETED
    return rows, end, status


class Block(NamedTuple):
    """Consecutive complete samples; the next block overwrites their rows."""

    time_ns: NDArray[np.int64]  # (n,)
    record: Array  # (n, columns of `signals` without those of the signal path)
    reference: Array  # (n, 15)
    path: Array  # (n, PATH.width) record of the signal path; `record` if there is none


def stream_run(
    run: PreparedRun, plan: Plan, record: Array, handle: Callable[[Block], None]
) -> tuple[int, RunStatus]:
    """Run `plan` in blocks of `len(record)` samples; return when it ended [ns], and how.

    `handle` is called with each block. The record of the signal path must have as many rows as `record`. The
    samples equal those of a run in one piece.
    """
    total, size = len(plan.time_ns), len(record)
    for first in range(0, total, size):
        piece = slice(first, min(first + size, total))
        reference = plan.reference[piece]
        inputs = run.inputs._replace(
            reference=reference, disturbance=plan.disturbance[piece], wind=plan.wind[piece]
        )
        rows, end, code = run.advance(inputs, run.path, record, run.memory, 0, len(reference))
        path = record if run.path is None else run.path.record
        handle(Block(plan.time_ns[first : first + rows], record[:rows], reference[:rows], path[:rows]))
        if code != RunStatus.RUNNING:
            return int(plan.time_ns[first + end]), RunStatus(code)
    return int(plan.time_ns[-1]), RunStatus.COMPLETED
