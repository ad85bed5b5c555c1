"""Define all signals in one table: names, symbols, units and order; records, logs, plots and docs use it.

The origin of the world frame is a corner of the rig at trolley height. On the laboratory rig x is along the
2 m side and y along the 1.54 m side; z is up. Units are SI units and radians.
"""

import functools
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, ClassVar, NamedTuple

if TYPE_CHECKING:
    from cranectl.support import Array


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

    STATE: ClassVar["SignalGroup"]
    LOAD: ClassVar["SignalGroup"]
    FLAT_OUTPUT: ClassVar["SignalGroup"]
    REFERENCE: ClassVar["SignalGroup"]
    ERROR: ClassVar["SignalGroup"]
    INPUT: ClassVar["SignalGroup"]
    VIRTUAL_INPUT: ClassVar["SignalGroup"]
    DISTURBANCE: ClassVar["SignalGroup"]
    LOAD_FORCE: ClassVar["SignalGroup"]
    MEASUREMENT: ClassVar["SignalGroup"]
    RESIDUAL: ClassVar["SignalGroup"]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(signal.name for signal in self.signals)

    def __len__(self) -> int:
        return len(self.signals)

    @classmethod
    def tracker_states(cls, robustifier_order: int) -> "SignalGroup":
        """Return the group of the flat tracker's states: the dynamic extension, then the robustifier."""
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
        return cls("controller", schema, "states of the controller", extension + robustifier)

    @classmethod
    def command(cls, kind: str) -> "SignalGroup":
        """Return the group of commands at the drives, after limits and delay, and of limits that act.

        `kind` is acceleration, velocity or force.
        """
        symbol, unit = {"acceleration": ("u", "m/s²"), "velocity": ("w", "m/s"), "force": ("F", "N")}[kind]
        axes = {"bridge": "x", "trolley": "y", "rope": "l"}.items()
        description = "commands that arrive at the drives, and whether a limit has cut them off"
        arriving = [
            Signal(f"{n}_command", f"{symbol}_{a}", unit, f"{kind} given to the {n} drive") for n, a in axes
        ]
        limited = [
            Signal(f"{n}_limited", f"sat_{a}", "1", f"1 while the {n} drive's limits act") for n, a in axes
        ]
        return cls("command", f"{kind.capitalize()}Command", description, (*arriving, *limited))

    @classmethod
    @functools.cache
    def measured(
        cls, commands: str = "", *, angles: bool = True, load: bool = True
    ) -> tuple["SignalGroup", ...]:
        """Return the groups of a measured run.

        `commands` is the kind of the measured commands: acceleration, velocity, force, or none. Without
        `angles` the run has the group `axes` in place of `state`; without `load`, no group `load`.
        """
        joints = cls("state", "MeasuredState", "measured joint positions, and their rates", cls.STATE.signals)
        if not angles:
            text = "measured positions of the axes, and rates"
            joints = cls("axes", "MeasuredAxes", text, cls.STATE.signals[:6])
        position = cls(
            "load", "MeasuredLoad", "measured position of the load, and rate", cls.LOAD.signals[:6]
        )
        arriving = cls.command(commands) if commands else None
        given = arriving and cls(
            "command", f"Measured{arriving.schema}", "measured commands of the drives", arriving.signals[:3]
        )
        return (joints, *((position,) if load else ()), *((given,) if given else ()))

    @classmethod
    @functools.cache
    def of_flat_tracker(cls, robustifier_order: int) -> tuple["SignalGroup", ...]:
        """Return the groups that only the flat tracker records: only it has z'' and above, v and ζ."""
        return (cls.FLAT_OUTPUT, cls.ERROR, cls.VIRTUAL_INPUT, cls.tracker_states(robustifier_order))

    @classmethod
    def of_controller(cls, name: str, logged: tuple[Signal, ...]) -> tuple["SignalGroup", ...]:
        """Return the groups that any other controller records: load, error and its own signals."""
        load = cls("flat_output", "LoadFromJoints", "load from the joints", cls.FLAT_OUTPUT.signals[:6])
        error = cls("error", "LoadError", "tracking error z_d - z and its rate", cls.ERROR.signals[:6])
        schema = f"Controller_{name.replace('-', '_')}"  # each controller has its own schema
        own = cls("controller", schema, f"signals that {name} logs", logged)
        return (load, error, own) if logged else (load, error)

    @classmethod
    @functools.cache
    def recorded(
        cls, controller_groups: tuple["SignalGroup", ...], *, staged: str = "", forced: bool = False
    ) -> tuple["SignalGroup", ...]:
        """Return all groups that a run records at every sample, in the order of columns.

        `staged` is the kind of command in a run with a signal path, which is recorded too. The forces on
        the load are recorded in a run with `forced` load.
        """
        path = (cls.MEASUREMENT, cls.command(staged)) if staged else ()
        return (*COMMON, *controller_groups, *path, *((cls.LOAD_FORCE,) if forced else ()))


@dataclass(frozen=True)
class _Part:
    """Gives a view of some of the signals of a state."""

    columns: slice

    def __get__(self, state: "State", _: type) -> "Array":
        part: Array = state.values[..., self.columns]
        return part


@dataclass(frozen=True)
class State:
    """States of a crane, shape (…, 10) in the order of `SignalGroup.STATE`, and views of their parts.

    Of a measured crane without angles only the columns of the axes may be there.
    """

    values: "Array"

    AXIS_NAMES: ClassVar = ("bridge_position", "trolley_position", "rope_length")
    axes = _Part(slice(0, 6, 2))  # positions of bridge and trolley, length of the rope
    axis_rates = _Part(slice(1, 6, 2))
    angles = _Part(slice(6, None, 2))  # alpha, beta
    swing = _Part(slice(6, None))  # the angles with their rates
    joints = _Part(slice(0, None, 2))  # axes and angles
    joint_rates = _Part(slice(1, None, 2))


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


SignalGroup.STATE = SignalGroup(
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

SignalGroup.LOAD = SignalGroup(
    "load",
    "Load",
    "world position and velocity of the load, and rope tension, from the plant itself",
    (
        *_derivatives("load", "z", "load as measured by the plant", range(2)),
        Signal("rope_tension", "S", "N", "positive when the rope pulls"),
    ),
)

SignalGroup.FLAT_OUTPUT = SignalGroup(
    "flat_output",
    "FlatOutput",
    "load position and derivatives, which the tracker computes from the joints and ζ",
    _derivatives("load", "z", "load as seen by the tracker", range(5)),
)

SignalGroup.REFERENCE = SignalGroup(
    "load",
    "Reference",
    "desired load position and derivatives",
    _derivatives("load", "z_d", "desired load", range(5)),
)

SignalGroup.ERROR = SignalGroup(
    "error",
    "TrackingError",
    "tracking error z_d - z and its derivatives",
    _derivatives("error", "e", "tracking error", range(4)),
)

SignalGroup.INPUT = SignalGroup(
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

SignalGroup.VIRTUAL_INPUT = SignalGroup(
    "virtual_input",
    "VirtualInput",
    "inputs of the linearised system z⁗ = v, and the robustifier's part of them",
    tuple(
        Signal(f"{name}_{axis}", f"{symbol}{subscript}", "m/s⁴", f"{symbol}, {axis}")
        for name, symbol in (("virtual_input", "v"), ("robustifier_output", "v̄"))
        for axis, subscript in zip(AXES, "₁₂₃", strict=True)
    ),
)

SignalGroup.DISTURBANCE = SignalGroup(
    "disturbance",
    "Disturbance",
    "angular accelerations added by disturbances",
    (
        Signal("alpha_disturbance", "d_α", "rad/s²", "added to the angular acceleration of alpha"),
        Signal("beta_disturbance", "d_β", "rad/s²", "added to the angular acceleration of beta"),
    ),
)

SignalGroup.LOAD_FORCE = SignalGroup(
    "load_force",
    "LoadForce",
    "force on the load by disturbances",
    tuple(Signal(f"load_force_{a}", f"f_{a}", "N", f"force on the load along {a}") for a in AXES),
)

SignalGroup.MEASUREMENT = SignalGroup(
    "measurement",
    "Measurement",
    "measured joint positions and velocities, and disturbances estimated by the observer",
    (
        *SignalGroup.STATE.signals,
        Signal("alpha_disturbance_estimate", "d̂_α", "rad/s²", "unexplained angular acceleration of alpha"),
        Signal("beta_disturbance_estimate", "d̂_β", "rad/s²", "unexplained angular acceleration of beta"),
    ),
)

_RESIDUALS = (
    ("bridge", "x_c", "m"), ("trolley", "y_c", "m"), ("rope", "l", "m"), ("alpha", "α", "rad"),
    ("beta", "β", "rad"), ("load_x", "z₁", "m"), ("load_y", "z₂", "m"), ("load_z", "z₃", "m"),
)  # fmt: skip
SignalGroup.RESIDUAL = SignalGroup(
    "residual",
    "Residual",
    "measured minus predicted",
    tuple(Signal(f"{n}_residual", f"Δ{s}", u, f"measured minus predicted {n}") for n, s, u in _RESIDUALS),
)

# Judged controllers of the benchmark, whose files must not change, import these.
STATE, REFERENCE, MEASUREMENT = SignalGroup.STATE, SignalGroup.REFERENCE, SignalGroup.MEASUREMENT

# Recorded in every simulated run, with any controller.
COMMON = (SignalGroup.STATE, SignalGroup.LOAD, SignalGroup.INPUT, SignalGroup.DISTURBANCE)

# Indices within groups for kernels: in the state, of axes, and of derivatives, which have three axes each.
BRIDGE, BRIDGE_RATE, TROLLEY, TROLLEY_RATE, ROPE, ROPE_RATE, ALPHA, ALPHA_RATE, BETA, BETA_RATE = range(10)
X, Y, Z = range(len(AXES))
POSITION, VELOCITY, ACCELERATION, JERK, SNAP = range(0, len(SignalGroup.REFERENCE), len(AXES))
TENSION = SignalGroup.LOAD.names.index("rope_tension")  # index in the group of the load


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
    path_command: int  # of the commands in the record of a signal path, which has a width of its own
    path_width: int


_STARTS = (0, *accumulate(len(group) for group in SignalGroup.recorded(SignalGroup.of_flat_tracker(0))))
_OWN = _STARTS[len(COMMON)]  # of what a controller adds
_PATH = len(SignalGroup.MEASUREMENT), len(SignalGroup.MEASUREMENT) + len(SignalGroup.command("acceleration"))
_TENSION = _STARTS[COMMON.index(SignalGroup.LOAD)] + TENSION
COLUMN = RecordColumns._make((*_STARTS, _TENSION, _OWN + 6, _OWN + 12, *_PATH))
