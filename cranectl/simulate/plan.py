"""Sample the reference and the disturbances of a scenario, and check them against the rig."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.model import states_and_inputs
from cranectl.plants import Plant
from cranectl.reference import Trajectory
from cranectl.scenario import NANOSECONDS, Scenario, ScenarioFile
from cranectl.signals import ACCELERATION, ALPHA, BETA, ROPE, SignalGroup, State, Z
from cranectl.simulate.memory import RunMemory
from cranectl.support import Array, InputError

AXES = ("bridge", "trolley", "rope")
STILL = (  # what is 0 at the start if bridge, trolley or rope is fixed
    ("bridge_velocity", "beta", "beta_rate"),
    ("trolley_velocity", "alpha", "alpha_rate"),
    ("rope_length_rate",),
)
FIXED = 1e-9  # [m, rad] of a fixed axis along the reference, from rounding; and of its rates


@dataclass(frozen=True)
class PlannedReference:
    """The desired motion at every control sample of a run, including its end; it depends on no plant."""

    time_ns: NDArray[np.int64]  # (N,)
    reference: Array  # (N, 15) load position and four derivatives
    reference_state: Array  # (N, 10) state of the crane on the reference
    gravity: float  # for which the states are computed [m/s²]

    @classmethod
    def of(cls, scenario: Scenario) -> "PlannedReference":
        """Sample the reference of a scenario.

        Raises InputError if the reference is not smooth enough, needs a slack rope, leaves the workspace, is
        faster than the drives, or takes too much memory.
        """
        RunMemory(scenario).check_planned()
        time_ns = np.arange(scenario.steps + 1, dtype=np.int64) * scenario.period_ns
        reference = Trajectory.of(scenario.reference).sample(time_ns / NANOSECONDS)
        _check_taut(scenario, time_ns, reference)  # first, since a slack rope has no direction
        states, _ = states_and_inputs(reference, scenario.rig.gravity)
        _check_axes(scenario, time_ns, states)
        _check_workspace(scenario, time_ns, states)
        _check_speed(scenario, time_ns, states)
        return PlannedReference(time_ns, reference, states, scenario.rig.gravity)

    def plan(self, scenario: Scenario) -> "Plan":
        """Plan the run of `scenario` on this reference, which may have been planned for another crane.

        Raises InputError if the run would start outside the workspace.
        """
        disturbances = scenario.disturbances_at(self.time_ns)
        air = scenario.air_velocity(len(self.time_ns))
        return Plan(
            self.time_ns,
            self.reference,
            self.reference_state,
            self.gravity,
            scenario=scenario,
            initial_state=_initial_state(scenario, self),
            disturbance=np.ascontiguousarray(disturbances[:, :2]),  # or loops are compiled for strides
            wind=np.hstack([air, disturbances[:, 2:]]),
        )


@dataclass(frozen=True)
class Plan(PlannedReference):
    """A planned reference with the scenario of a run, its initial state and its disturbances."""

    scenario: Scenario  # what is run; its rig and effects may differ from those of the reference
    initial_state: Array  # (10,) on the reference, unless the scenario has offsets
    disturbance: Array  # (N, 2) [rad/s²]
    wind: Array  # (N, 6) velocity of the air [m/s], other force on the load [N]

    @classmethod
    def of(cls, scenario: Scenario) -> "Plan":
        """Plan a scenario; raise InputError as `PlannedReference.of` and `PlannedReference.plan` do."""
        return PlannedReference.of(scenario).plan(scenario)

    @property
    def shortest_rope(self) -> float:
        """The shortest rope length of the reference and the start [m]."""
        return float(min(self.reference_state[:, ROPE].min(), self.initial_state[ROPE]))

    def begin(self, plant: Plant) -> None:
        """Put `plant` at the start.

        Raises InputError if its effects or steps do not allow the shortest rope.
        """
        # `reset` comes first: an elastic rope keeps the viscosity that it gets there, and a damped rope
        # decays the faster the shorter it becomes.
        plant.reset(self.initial_state)
        plant.check_length(self.shortest_rope)

    def rows_at(self, index: NDArray[np.integer[Any]]) -> tuple[Array, Array, Array]:
        """Return copies of reference, disturbance and wind at samples `index` (n,).

        After the end the last row of each is repeated.
        """
        return rows_at(self.reference, index), rows_at(self.disturbance, index), rows_at(self.wind, index)


def rows_at(rows: Array, index: NDArray[np.integer[Any]] | np.integer[Any]) -> Array:
    """Return the rows at samples `index` (n,), or one, as a copy; after the end the last row is repeated."""
    # NumPy returns a view of one row, and a copy of several.
    chosen: Array = rows[np.minimum(index, len(rows) - 1)]
    return chosen.copy() if np.ndim(index) == 0 else chosen


def rows_between(rows: Array, first: int, last: int) -> Array:
    """Return the rows `first` to `last` - 1; after the end the last row is repeated."""
    return rows[first:last] if last <= len(rows) else rows_at(rows, np.arange(first, last))


def _initial_state(scenario: Scenario, planned: PlannedReference) -> Array:
    """Return the first state of the reference, moved and swung by the scenario's offsets."""
    row = planned.reference[:1].copy()
    row[:, :3] += scenario.initial.load_offset
    state: Array = states_and_inputs(row, planned.gravity)[0][0]
    state[ALPHA] += scenario.initial.alpha_offset
    state[BETA] += scenario.initial.beta_offset
    check_start(scenario, state, remedy="reduce the offsets in [initial]")
    return state


def check_start(scenario: Scenario, state: Array, *, remedy: str, what: str = "the run would start") -> None:
    """Raise InputError if `state` (10,) is outside the workspace, at pi/2, or moves a fixed axis."""
    _check_fixed(scenario, state, what)
    low, high = scenario.rig.workspace.T
    axes = State(state).axes
    outside = (axes < low - 1e-9) | (axes > high + 1e-9)  # a start at the very end of a range is inside
    if outside.any() or np.abs(State(state).angles).max() >= 0.5 * np.pi:
        worst = int(np.argmax([*outside, True]))  # 3, the angle, if no axis is outside
        name = [*State.AXIS_NAMES, "a cardan angle"][worst]
        value = f" = {axes[worst]:.4g} m, of {low[worst]:g} to {high[worst]:g}" if worst < 3 else ""
        raise InputError(
            f"{what} outside the workspace: {name}{value}",
            allowed="positions within the rig's ranges, with angles within pi/2",
            remedy=remedy,
        )


def _check_fixed(scenario: Scenario, state: Array, what: str) -> None:
    """Raise InputError if a start moves a fixed axis, or swings the load of a planar crane across it."""
    rig = scenario.rig
    for name in (name for names, moves in zip(STILL, rig.moves, strict=True) if not moves for name in names):
        value = state[SignalGroup.STATE.names.index(name)]
        if abs(value) > FIXED:
            raise InputError(
                f"{what} with {name} = {value:.4g} on a crane with rig.axes = '{rig.axes}' and rig.rope = "
                f"'{rig.rope}'",
                allowed=f"{name} = 0",
                remedy=f"set {name} to 0, or let the axis move",
            )


def _check_axes(scenario: Scenario, time_ns: NDArray[np.int64], states: Array) -> None:
    for axis in np.flatnonzero(~np.array(scenario.rig.moves[:2])):
        position = State(states).axes[:, axis]
        away = np.abs(position - position[0])
        worst = int(np.argmax(away))
        if away[worst] > FIXED:
            raise InputError(
                f"the reference moves the {AXES[axis]} by {away[worst]:.4g} m until "
                f"{time_ns[worst] / NANOSECONDS:g} s, but rig.axes = '{scenario.rig.axes}'",
                allowed=f"a reference that keeps {'xy'[axis]} of its start, {position[0]:.6g} m",
                remedy=f"give all points this {'xy'[axis]}, or set rig.axes to 'xy'",
            )


def _check_taut(scenario: Scenario, time_ns: NDArray[np.int64], reference: Array) -> None:
    lift = reference[:, ACCELERATION + Z] + scenario.rig.gravity
    worst = int(np.argmin(lift))
    if lift[worst] <= 0.0:
        raise InputError(
            f"the reference needs a slack rope: at {time_ns[worst] / NANOSECONDS:g} s the load falls with "
            f"{-reference[worst, ACCELERATION + Z]:.3g} m/s²",
            allowed=f"downward accelerations below g = {scenario.rig.gravity:g} m/s²",
            remedy="give the segment more time",
        )
    highest = int(np.argmax(reference[:, Z]))
    if reference[highest, Z] >= 0.0:
        raise InputError(
            f"the reference lifts the load to z = {reference[highest, Z]:.3g} m at "
            f"{time_ns[highest] / NANOSECONDS:g} s",
            allowed="z below 0, the height of the trolley",
            remedy="lower the path",
        )


def _check_speed(scenario: Scenario, time_ns: NDArray[np.int64], states: Array) -> None:
    if scenario.effects.limits is None:
        return
    speed, limits = np.abs(State(states).axis_rates), scenario.effects.limits.velocity
    worst, axis = np.unravel_index(int(np.argmax(speed / limits)), speed.shape)
    if speed[worst, axis] > limits[axis]:
        raise InputError(
            f"the reference moves faster than the drive of the {AXES[axis]} can: "
            f"{speed[worst, axis]:.3g} m/s at {time_ns[worst] / NANOSECONDS:g} s",
            allowed=f"up to effects.limits.velocity = {limits[axis]:g} m/s",
            remedy="give the segment more time, or correct effects.limits.velocity",
        )


def _check_workspace(scenario: Scenario, time_ns: NDArray[np.int64], states: Array) -> None:
    for axis, (name, (low, high)) in enumerate(zip(State.AXIS_NAMES, scenario.rig.workspace, strict=True)):
        position = State(states).axes[:, axis]
        excess = np.maximum(low - position, position - high)
        worst = int(np.argmax(excess))
        if excess[worst] > 1e-9:  # [m]; a path along the end of a range is inside, rounded or not
            raise InputError(
                f"the reference leaves the workspace: {name} = {position[worst]:.4g} m at "
                f"{time_ns[worst] / NANOSECONDS:g} s",
                allowed=f"rig.{AXES[axis]}_range, from {low:g} to {high:g} m",
                remedy=f"move the path, give it more time, or change rig.{AXES[axis]}_range"
                + ScenarioFile.made_for(scenario.rig.workspace),
            )
