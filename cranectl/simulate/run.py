"""A run: all signals at every sample, and how it ended."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cranectl.design import ControllerDesign
from cranectl.plants import DRIVES, FORCE, Drive, PhysicsStep
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import TENSION, SignalGroup, State
from cranectl.status import RunStatus
from cranectl.support import Array


@dataclass(frozen=True)
class Run:
    """Hold a run in memory, as simulated or as read from a log.

    Parameters
    ----------
    scenario : Scenario
        What was run; its default physics step is stated, as a number.
    design : ControllerDesign
        The controller.
    plant, drive : str
        Plant and kind of drive.
    model : str
        The plant's own description, MJCF for MuJoCo.
    time_ns : ndarray, shape (N,)
        Simulated time from 0 [ns].
    table : ndarray, shape (N, columns of `groups`)
        All signals.
    reference : ndarray, shape (N, 15) or (N, 0)
        The reference, in the order of `SignalGroup.REFERENCE`; no columns without a reference.
    status : RunStatus
        How the run ended.
    end_ns : int
        When it ended [ns].
    own_groups : tuple of SignalGroup, optional
        The groups of a run without a reference: of a measured crane, or of a model that repeats its motion.
        All other runs record the groups of their scenario, design and drive.
    """

    scenario: Scenario
    design: ControllerDesign
    plant: str
    drive: Drive
    model: str
    time_ns: NDArray[np.int64]
    table: Array
    reference: Array
    status: RunStatus
    end_ns: int
    own_groups: tuple[SignalGroup, ...] | None = None

    def __post_init__(self) -> None:
        """State the physics step, so that the record does not depend on how it is chosen."""
        object.__setattr__(self, "scenario", PhysicsStep(self.scenario, self.drive).stated())

    @property
    def has_reference(self) -> bool:
        """Whether the load follows a reference; a measured run has none, and no errors and limits."""
        return self.own_groups is None

    @property
    def time(self) -> Array:
        """Simulation time [s], shape (N,)."""
        seconds: Array = self.time_ns / NANOSECONDS
        return seconds

    @property
    def controller(self) -> str:
        """The name of the controller, with the file of one from outside the package."""
        origin = self.design.origin
        return self.design.name if origin is None else f"{self.design.name}, {origin.described}"

    @property
    def end_s(self) -> float:
        """When the run ended [s]."""
        return self.end_ns / NANOSECONDS

    @property
    def ended_as_expected(self) -> bool:
        """Whether the run ended as its scenario expects."""
        return self.status.label == self.scenario.expected

    @property
    def load_position(self) -> Array:
        """Position of the load in the world (x, y, z) [m], shape (N, 3); a view."""
        return self.block("load")[:, :3]

    @property
    def load_force(self) -> Array:
        """Force of disturbances on the load (x, y, z) [N], shape (N, 3)."""
        return self.block("load_force") if self.scenario.forced else np.zeros((len(self.time_ns), 3))

    @property
    def tension(self) -> Array:
        """Tension of the rope [N], positive when it pulls, shape (N,); a view."""
        return self.block("load")[:, TENSION]

    @property
    def has_tension(self) -> bool:
        """Whether the tension of the rope is known; nobody measures it."""
        return self.has("load") and len(self.block("load").T) > TENSION

    @property
    def state(self) -> State:
        """The states, with views by name; only axes if no angles were measured."""
        return State(self.block("state" if self.has("state") else "axes"))

    @property
    def angles(self) -> Array:
        """Cardan angles alpha, beta [rad], shape (N, 2); a view."""
        return self.state.angles

    @property
    def commands(self) -> Array:
        """Commands that arrive at the drives of bridge, trolley and rope, shape (N, 3); a view."""
        return self.block("command")[:, :3]

    @property
    def reference_position(self) -> Array:
        """Desired position of the load (x, y, z) [m], shape (N, 3); a view."""
        return self.reference[:, :3]

    @property
    def load_residual(self) -> Array:
        """How far the measured load is from the predicted one [m], shape (N,), in a predicted run."""
        distance: Array = np.linalg.norm(self.block("residual")[:, 5:], axis=1)
        return distance

    @property
    def workspace_excess(self) -> Array:
        """How far bridge, trolley and rope are outside their ranges [m], shape (N, 3); 0 if inside."""
        positions = self.state.axes
        low, high = self.scenario.rig.workspace.T
        excess: Array = low - positions
        for axis in range(3):  # runs may be long: no second array of this size
            np.maximum(excess[:, axis], positions[:, axis] - high[axis], out=excess[:, axis])
        return np.maximum(excess, 0.0, out=excess)

    @property
    def groups(self) -> tuple[SignalGroup, ...]:
        """The recorded groups, in column order."""
        if self.own_groups is not None:
            return self.own_groups
        return self.groups_of(self.scenario, self.design, self.drive)

    @staticmethod
    def whole_record(scenario: Scenario, record: Array, path_record: Array | None, wind: Array) -> Array:
        """Return a record joined with the columns of its signal path and of forces on the load."""
        parts = [record] if path_record is None else [record, path_record]
        if scenario.forced:
            parts.append(wind[:, FORCE:])
        return np.hstack(parts) if len(parts) > 1 else record

    @staticmethod
    def groups_of(scenario: Scenario, design: ControllerDesign, drive: Drive) -> tuple[SignalGroup, ...]:
        """Return the groups that a run with a reference records, in column order."""
        kind = DRIVES[drive]
        staged = kind.command if kind.has_signal_path(scenario.effects) else ""
        return SignalGroup.recorded(design.groups, staged=staged, forced=scenario.forced)

    def has(self, *groups: str) -> bool:
        """Return True if the run has all these groups of signals, e.g. `run.has("state", "load")`."""
        return {group.name for group in self.groups}.issuperset(groups)

    def block(self, group: str) -> Array:
        """Return a view of all signals of one group, shape (N, signals), e.g. `run.block("state")`."""
        start = 0
        for candidate in self.groups:
            if candidate.name == group:
                return self.table[:, start : start + len(candidate)]
            start += len(candidate)
        raise KeyError(f"no group '{group}'; known: {', '.join(g.name for g in self.groups)}")

    def signal(self, name: str) -> Array:
        """Return a view of one signal by group and name, shape (N,), e.g. `run.signal("state.alpha")`."""
        group_name, _, signal = name.partition(".")
        block = self.block(group_name)
        names = next(group.names for group in self.groups if group.name == group_name)
        if signal not in names:
            raise KeyError(f"no signal '{signal}' in '{group_name}'; known: {', '.join(names)}")
        return block[:, names.index(signal)]

    def every(self, n: int) -> "Run":
        """Return the run at every n-th control sample, and always at the last one.

        A run that was read from a log has only the samples of that log. Evenly spaced samples are views.
        """
        # Slices instead of [0] and [-1], since a run may have no samples.
        samples = (self.time_ns - self.time_ns[:1]) // self.scenario.period_ns
        mask = samples % n == 0
        mask[-1:] = True
        chosen = slice(None, None, n) if mask[::n].all() and mask.sum() == mask[::n].size else mask
        return replace(
            self, time_ns=self.time_ns[chosen], table=self.table[chosen], reference=self.reference[chosen]
        )
