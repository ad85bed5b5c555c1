"""A controller that is prepared for a crane and a reference: all that a loop runs of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl import controllers
from cranectl.controllers import (
    ALL_CONTROLLERS,
    CompiledController,
    Controller,
    LinearController,
    Nominal,
    linearised,
)
from cranectl.design import ControllerDesign
from cranectl.plants import DRIVES, Drive
from cranectl.reference import Trajectory
from cranectl.scenario import NANOSECONDS, RigParameters, Scenario
from cranectl.signals import COLUMN, ROPE, SignalGroup, Z
from cranectl.simulate.plan import Plan, PlannedReference
from cranectl.support import Array, InputError


@dataclass(frozen=True)
class PreparedController:
    """Hold a controller that is prepared for a crane and a reference; several loops may share it.

    Parameters
    ----------
    nominal : Scenario
        The crane that the controller assumes.
    design : ControllerDesign
        The controller with its settings.
    reference : PlannedReference
        What it follows.
    compiled : CompiledController
        The form that loops run.
    """

    nominal: Scenario
    design: ControllerDesign
    reference: PlannedReference
    compiled: CompiledController

    @classmethod
    def of(
        cls, nominal: Scenario, design: ControllerDesign, drive: Drive, reference: PlannedReference
    ) -> "PreparedController":
        """Prepare `design` for a reference, with a kind of drive, on the crane `nominal`.

        Raises InputError if the sampled loop is unstable, or as the controller's own preparation does.
        """
        controller = ALL_CONTROLLERS.of_design(design)
        crane = nominal_crane(nominal, design, controller, drive, reference)
        compiled = CompiledController.of(controller, crane, sum(map(len, design.groups)))
        return cls(nominal, design, reference, compiled)

    @classmethod
    def repeating(
        cls, plan: Plan, drive: Drive, rows: Array, controller: Controller | str = "measured-commands"
    ) -> "PreparedController":
        """Prepare a controller that reads its row of numbers at each sample of a plan, not a reference.

        By default it repeats commands for drives of this kind, `rows` (N, 3), and has only a name. Another
        one may read up to 15 numbers of a row. The copy of `rows` is `compiled.reference`.
        """
        scenario, padded = plan.scenario, np.zeros((len(rows), len(SignalGroup.REFERENCE)))
        padded[:, : rows.shape[1]] = rows
        if isinstance(controller, str):
            controller = controllers.repeated_commands(DRIVES[drive].command, controller)
        period = scenario.period_ns / NANOSECONDS
        nominal = Nominal(scenario.limited_rig, drive, period, padded, plan.initial_state, {})
        design = ControllerDesign(controller.name)
        compiled = CompiledController.of(controller, nominal, sum(map(len, design.groups)))
        return cls(scenario, design, plan, compiled)

    def records(self, rows: int) -> tuple[Array, Array]:
        """Return arrays for that many samples of a loop: its record, and that of its signal path."""
        return np.zeros((rows, self.design.record_width)), np.zeros((rows, COLUMN.path_width))

    @staticmethod
    def near_rest(
        nominal: Scenario, design: ControllerDesign, rope_lengths: Sequence[float] = ()
    ) -> list[LinearController]:
        """Return the controller linearised at some rope lengths [m]; empty if it has no linear form.

        The default lengths are the shortest, the middle and the longest rope of the rig.
        """
        controller = ALL_CONTROLLERS.of_design(design)
        if controller.linearise is None:
            return []
        known = nominal_crane(nominal, design, controller, "ideal", PlannedReference.of(nominal))
        shortest, longest = nominal.rig.rope_range
        lengths = rope_lengths or (shortest, 0.5 * (shortest + longest), longest)
        return [linearised(controller, known, length) for length in lengths]


def nominal_crane(
    nominal: Scenario,
    design: ControllerDesign,
    controller: Controller,
    drive: Drive,
    planned: PlannedReference,
) -> Nominal:
    """Return the data of crane, drives and reference with which `controller` is prepared."""
    reference, ropes = planned.reference, planned.reference_state[:, ROPE]
    if controller.follows == "set-point":
        reference = Trajectory.of(nominal.reference).set_points(planned.time_ns / NANOSECONDS)
        ropes = -reference[:, Z]
    if nominal.rig.rope == "fixed":
        _check_fixed_rope(controller, design.name, ropes, planned.time_ns)
    return Nominal(
        rig=nominal.limited_rig,
        drive=drive,
        period=controller.every * nominal.period_ns / NANOSECONDS,
        reference=reference,
        state=planned.reference_state[0],
        parameters=design.parameters,
        axis_design=design.axis_design,
    )


def _check_fixed_rope(controller: Controller, name: str, ropes: Array, time_ns: NDArray[np.int64]) -> None:
    """Raise InputError if `controller` or its reference, with these lengths of rope [m], needs a winch.

    `name` is that of the design.
    """
    if controller.needs_winch:
        raise InputError(
            f"controller {name} on a crane with rig.rope = 'fixed'",
            allowed="controllers that need no winch: with a fixed rope no crane is differentially flat",
            remedy="take lqr-integral, pid or a controller of your own, or set rig.rope to 'hoisted'",
        )
    changes = np.abs(ropes - ropes[0])
    worst = int(np.argmax(changes))
    if changes[worst] > RigParameters.ROPE_TOLERANCE * ropes[0]:
        raise InputError(
            f"the {controller.follows} of {controller.name} changes the rope by {changes[worst]:.3g} m until "
            f"{time_ns[worst] / NANOSECONDS:g} s, but rig.rope = 'fixed'",
            allowed="set-points of one height, or a path that a load on such a rope can follow: one of kind "
            "'move', which is planned for it",
            remedy="give points of one height, and kind = 'move' or a controller that follows set-points",
        )
