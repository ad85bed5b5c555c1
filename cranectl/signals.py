"""Define all signals in one table: names, symbols, units and order; records, logs, plots and docs use it.

The origin of the world frame is a corner of the rig at trolley height. On the laboratory rig x is along the
2 m side and y along the 1.54 m side; z is up. Units are SI units and radians.
"""

import functools
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Signal:
    """Describe one scalar signal.

    Parameters
    ----------
    name, symbol, unit, description : str
        Name in records, symbol in figures, SI unit and meaning.
    """

    name: str
    symbol: str
    unit: str
    description: str


@dataclass(frozen=True, slots=True)
class SignalGroup:
    """Signals that are recorded together, as a block of columns in memory and a topic in a log."""

    name: str
    schema: str  # message type in logs
    description: str
    signals: tuple[Signal, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(signal.name for signal in self.signals)

    def __len__(self) -> int:
        return len(self.signals)


AXES = ("x", "y", "z")
DERIVATIVE_SUFFIXES = ("", "_dot", "_ddot", "_d3", "_d4")
_DERIVATIVE_UNITS = ("m", "m/s", "m/s²", "m/s³", "m/s⁴")
_DERIVATIVE_MARKS = ("", "\u0307", "\u0308", "\u20db", "\u20dc")
_DERIVATIVE_NAMES = ("position", "velocity", "acceleration", "third derivative", "fourth derivative")


def _derivatives(stem: str, symbol: str, quantity: str, orders: range) -> tuple[Signal, ...]:
    """Return the signals `stem_x, stem_y, stem_z` and their time derivatives, ordered by derivative."""
    return tuple(
        Signal(
            f"{stem}_{axis}{DERIVATIVE_SUFFIXES[order]}",
            f"{symbol}{_DERIVATIVE_MARKS[order]}{subscript}",
            _DERIVATIVE_UNITS[order],
            f"{quantity}, {axis}, {_DERIVATIVE_NAMES[order]}",
        )
        for order in orders
        for axis, subscript in zip(AXES, "₁₂₃", strict=True)
    )


STATE = SignalGroup(
    "state",
    "State",
    "joint positions and velocities, in the order of the thesis's (3.21)",
    (
        Signal("bridge_position", "x_c", "m", "bridge along x"),
        Signal("bridge_velocity", "ẋ_c", "m/s", "bridge along x"),
        Signal("trolley_position", "y_c", "m", "trolley along y"),
        Signal("trolley_velocity", "ẏ_c", "m/s", "trolley along y"),
        Signal("rope_length", "l", "m", "pivot to load, positive"),
        Signal("rope_length_rate", "l̇", "m/s", "positive when paying out"),
        Signal("alpha", "α", "rad", "outer cardan angle, about +x"),
        Signal("alpha_rate", "α̇", "rad/s", "rate of alpha"),
        Signal("beta", "β", "rad", "inner cardan angle, about -y"),
        Signal("beta_rate", "β̇", "rad/s", "rate of beta"),
    ),
)

LOAD = SignalGroup(
    "load",
    "Load",
    "world position and velocity of the load, and rope tension, from the plant itself",
    (
        *_derivatives("load", "z", "load as measured by the plant", range(2)),
        Signal("rope_tension", "S", "N", "positive when the rope pulls"),
    ),
)

FLAT_OUTPUT = SignalGroup(
    "flat_output",
    "FlatOutput",
    "load position and derivatives, which the tracker computes from the joints and ζ",
    _derivatives("load", "z", "load as seen by the tracker", range(5)),
)

REFERENCE = SignalGroup(
    "load",
    "Reference",
    "desired load position and derivatives",
    _derivatives("load", "z_d", "desired load", range(5)),
)

ERROR = SignalGroup(
    "error",
    "TrackingError",
    "tracking error z_d - z and its derivatives",
    _derivatives("error", "e", "tracking error", range(4)),
)

INPUT = SignalGroup(
    "input",
    "Input",
    "commands of the tracker: accelerations for ideal drives, set-points for velocity drives",
    (
        Signal("bridge_acceleration", "u_x", "m/s²", "commanded bridge acceleration"),
        Signal("trolley_acceleration", "u_y", "m/s²", "commanded trolley acceleration"),
        Signal("rope_acceleration", "u_l", "m/s²", "commanded rope acceleration"),
        Signal("bridge_velocity_setpoint", "w_x", "m/s", "set-point of the bridge drive"),
        Signal("trolley_velocity_setpoint", "w_y", "m/s", "set-point of the trolley drive"),
        Signal("rope_velocity_setpoint", "w_l", "m/s", "set-point of the winch drive"),
    ),
)

VIRTUAL_INPUT = SignalGroup(
    "virtual_input",
    "VirtualInput",
    "inputs of the linearised system z⁗ = v, and the robustifier's part of them",
    tuple(
        Signal(f"{name}_{axis}", f"{symbol}{subscript}", "m/s⁴", f"{symbol}, {axis}")
        for name, symbol in (("virtual_input", "v"), ("robustifier_output", "v̄"))
        for axis, subscript in zip(AXES, "₁₂₃", strict=True)
    ),
)

DISTURBANCE = SignalGroup(
    "disturbance",
    "Disturbance",
    "angular accelerations added by disturbances",
    (
        Signal("alpha_disturbance", "d_α", "rad/s²", "added to the angular acceleration of alpha"),
        Signal("beta_disturbance", "d_β", "rad/s²", "added to the angular acceleration of beta"),
    ),
)


LOAD_FORCE = SignalGroup(
    "load_force",
    "LoadForce",
    "force on the load by disturbances",
    tuple(Signal(f"load_force_{a}", f"f_{a}", "N", f"force on the load along {a}") for a in AXES),
)


def controller_group(robustifier_order: int) -> SignalGroup:
    """Return the group of the flat tracker's states: the dynamic extension, then the robustifier by axis."""
    extension = (
        Signal("zeta", "ζ", "m/s²", "vertical load acceleration held by the tracker"),
        Signal("zeta_dot", "ζ̇", "m/s³", "rate of zeta"),
    )
    robustifier = tuple(
        Signal(f"robustifier_{axis}_{k}", f"ξ_{axis}{k}", "1", f"robustifier state {k}, {axis}")
        for axis in AXES
        for k in range(1, robustifier_order + 1)
    )
    # A schema name must mean one schema, so each length has its own name.
    schema = f"Controller{robustifier_order or ''}"
    return SignalGroup("controller", schema, "states of the controller", extension + robustifier)


MEASUREMENT = SignalGroup(
    "measurement",
    "Measurement",
    "measured joint positions and velocities, and disturbances estimated by the observer",
    (
        *STATE.signals,
        Signal("alpha_disturbance_estimate", "d̂_α", "rad/s²", "unexplained angular acceleration of alpha"),
        Signal("beta_disturbance_estimate", "d̂_β", "rad/s²", "unexplained angular acceleration of beta"),
    ),
)


_RESIDUALS = (
    ("bridge", "x_c", "m"), ("trolley", "y_c", "m"), ("rope", "l", "m"), ("alpha", "α", "rad"),
    ("beta", "β", "rad"), ("load_x", "z₁", "m"), ("load_y", "z₂", "m"), ("load_z", "z₃", "m"),
)  # fmt: skip
RESIDUAL = SignalGroup(
    "residual",
    "Residual",
    "measured minus predicted",
    tuple(
        Signal(f"{n}_residual", f"Δ{s}", unit, f"measured minus predicted {n}") for n, s, unit in _RESIDUALS
    ),
)

_COMMANDS = {"acceleration": ("u", "m/s²"), "velocity": ("w", "m/s"), "force": ("F", "N")}  # symbol, unit


def command_group(kind: str) -> SignalGroup:
    """Return the group of commands at the drives, after limits and delay, and of limits that act.

    `kind` is acceleration, velocity or force.
    """
    symbol, unit = _COMMANDS[kind]
    axes = {"bridge": "x", "trolley": "y", "rope": "l"}.items()
    description = "commands that arrive at the drives, and whether a limit has cut them off"
    arriving = [
        Signal(f"{n}_command", f"{symbol}_{a}", unit, f"{kind} given to the {n} drive") for n, a in axes
    ]
    limited = [
        Signal(f"{n}_limited", f"sat_{a}", "1", f"1 while the {n} drive's limits act") for n, a in axes
    ]
    return SignalGroup("command", f"{kind.capitalize()}Command", description, (*arriving, *limited))


COMMON = (STATE, LOAD, INPUT, DISTURBANCE)  # recorded in every simulated run, with any controller


@functools.cache
def measured_groups(commands: str = "", *, angles: bool = True, load: bool = True) -> tuple[SignalGroup, ...]:
    """Return the groups of a measured run.

    `commands` is the kind of the measured commands: acceleration, velocity, force, or none. Without `angles`
    the run has the group `axes` in place of `state`. Without `load` nothing says where the load was.
    """
    joints = (
        SignalGroup("state", "MeasuredState", "measured joint positions, and their rates", STATE.signals)
        if angles
        else SignalGroup(
            "axes", "MeasuredAxes", "measured positions of the axes, and rates", STATE.signals[:6]
        )
    )
    position = SignalGroup(
        "load", "MeasuredLoad", "measured position of the load, and rate", LOAD.signals[:6]
    )
    arriving = command_group(commands) if commands else None
    given = arriving and SignalGroup(
        "command", f"Measured{arriving.schema}", "measured commands of the drives", arriving.signals[:3]
    )
    return (joints, *((position,) if load else ()), *((given,) if given else ()))


@functools.cache
def flat_groups(robustifier_order: int) -> tuple[SignalGroup, ...]:
    """Return the groups that only the flat tracker records: only it has z'' and above, v and ζ."""
    return (FLAT_OUTPUT, ERROR, VIRTUAL_INPUT, controller_group(robustifier_order))


def controller_groups_of(name: str, logged: tuple[Signal, ...]) -> tuple[SignalGroup, ...]:
    """Return the groups that any other controller records: load, error and its own signals."""
    load = SignalGroup("flat_output", "LoadFromJoints", "load from the joints", FLAT_OUTPUT.signals[:6])
    error = SignalGroup("error", "LoadError", "tracking error z_d - z and its rate", ERROR.signals[:6])
    schema = f"Controller_{name.replace('-', '_')}"  # each controller has its own schema
    own = SignalGroup("controller", schema, f"signals that {name} logs", logged)
    return (load, error, own) if logged else (load, error)


@functools.cache
def recorded_groups(
    controller_groups: tuple[SignalGroup, ...], *, staged: str = "", forced: bool = False
) -> tuple[SignalGroup, ...]:
    """Return all groups that a run records at every sample, in the order of columns.

    `staged` is the kind of command in a run with a signal path, which is recorded too. The forces on the load
    are recorded in a run with `forced` load.
    """
    path = (MEASUREMENT, command_group(staged)) if staged else ()
    return (*COMMON, *controller_groups, *path, *((LOAD_FORCE,) if forced else ()))


# Indices within groups for kernels: in the state, of axes, and of derivatives, which have three axes each.
BRIDGE, BRIDGE_RATE, TROLLEY, TROLLEY_RATE, ROPE, ROPE_RATE, ALPHA, ALPHA_RATE, BETA, BETA_RATE = range(10)
X, Y, Z = range(len(AXES))
POSITION, VELOCITY, ACCELERATION, JERK, SNAP = range(0, len(REFERENCE), len(AXES))
TENSION = LOAD.names.index("rope_tension")  # index in the group of the load


class RecordColumns(NamedTuple):
    """First columns of what the compiled loops write into a record."""

    state: int
    load: int
    input: int
    disturbance: int
    flat_output: int  # of the flat tracker, as all that follows; other controllers record the load here
    error: int
    virtual_input: int
    controller: int
    width: int  # of a record of the flat tracker without states of a robustifier
    tension: int
    own_error: int  # of other controllers
    own_signals: int


class PathColumns(NamedTuple):
    """First column of the commands in the record of a signal path, and the width of that record."""

    command: int
    width: int


_STARTS = (0, *accumulate(len(group) for group in recorded_groups(flat_groups(0))))
_OWN = _STARTS[len(COMMON)]  # of what a controller adds
COLUMN = RecordColumns._make((*_STARTS, _STARTS[COMMON.index(LOAD)] + TENSION, _OWN + 6, _OWN + 12))
PATH = PathColumns(len(MEASUREMENT), len(MEASUREMENT) + len(command_group("acceleration")))

# Workspace axes: (signal, column in the state), the order of `RigParameters.workspace`.
WORKSPACE_SIGNALS = ("bridge_position", "trolley_position", "rope_length")
