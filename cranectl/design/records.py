"""Records of a controller in a run: its settings and, for the flat family, its linear design."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.signals import Signal, SignalGroup
from cranectl.support import Array, InconsistentError, InputError, Provenance

if TYPE_CHECKING:
    import control

    from cranectl.design.discretisation import SampledBlocks

Value = float | str  # of a parameter of a controller: a number, or one of its words
BY_HAND = ", gains by hand"  # end of the name of a design whose gains were changed
# The system z'''' = v of one axis, as arrays: importing python-control takes most of a second.
CHAIN_A: Array = np.diag(np.ones(3), 1)
CHAIN_B: Array = np.eye(4)[:, 3:]


@dataclass(frozen=True)
class Robustifier:
    """A linear system from e [m] to v-bar [m/s⁴], the same for each axis, in continuous time.

    xi' = A xi + B e, v-bar = C xi + D e, with A in the form of `real_modal_form`.
    """

    a: Array  # (n, n)
    b: Array  # (n,)
    c: Array  # (n,)
    d: float  # [1/s⁴]

    @property
    def order(self) -> int:
        """Number of states per axis."""
        return len(self.a)

    @property
    def sampled_order(self) -> int:
        """Number of states per axis when sampled in 2 x 2 blocks; the last may have no effect."""
        return 2 * ((self.order + 1) // 2)

    @property
    def static_gain(self) -> float:
        """Static gain K(0) from a constant error to v-bar [1/s⁴]; infinite with an integrator."""
        poles = np.linalg.eigvals(self.a)
        if self.order and np.abs(poles).min() < 1e-12 * np.abs(poles).max():
            return np.inf
        return float(self.d - self.c @ np.linalg.solve(self.a, self.b))

    @property
    def fastest_mode(self) -> tuple[float, float]:
        """Pole [1/s] of the fastest mode, and the magnitude of its part in the static gain [1/s⁴]."""
        poles, modes = np.linalg.eig(self.a)
        inputs, outputs = np.linalg.solve(modes, self.b.astype(complex)), self.c @ modes
        k = int(np.argmin(poles.real))
        return float(poles[k].real), float(abs(inputs[k] * outputs[k] / poles[k]))

    def system(self) -> "control.StateSpace":
        """Return the robustifier as a state-space system of python-control."""
        import control

        return control.ss(self.a, self.b[:, np.newaxis], self.c[np.newaxis], self.d)

    def sampled(self, period: float) -> "SampledBlocks":
        """Return the robustifier sampled with `period` [s]."""
        from cranectl.design.discretisation import sampled_blocks  # SciPy takes a while to import

        return sampled_blocks(self.a, self.b, self.c, self.d, period)

    def to_json(self) -> dict[str, Any] | None:
        """Return plain data, B as a column and C as a row, or None for the robustifier without effect."""
        if not self.order and not self.d:
            return None
        return {
            "A": self.a.tolist(),
            "B": self.b.reshape(-1, 1).tolist(),
            "C": self.c.reshape(1, -1).tolist(),
            "D": [[self.d]],
        }

    @classmethod
    def from_json(cls, data: dict[str, Any] | None) -> "Robustifier":
        """Return what `to_json` has written; raise ValueError for matrices that do not fit together."""
        if data is None:
            return NO_ROBUSTIFIER
        n = len(data["B"])
        return cls(
            a=np.array(data["A"], dtype=float).reshape(n, n),
            b=np.array(data["B"], dtype=float).reshape(n),
            c=np.array(data["C"], dtype=float).reshape(n),
            d=float(data["D"][0][0]),
        )


NO_ROBUSTIFIER = Robustifier(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0)


@dataclass(frozen=True)
class Margins:
    """Stability margins of the loop, cut at v. T = 1 - S is its complementary sensitivity."""

    gain_margin: float  # factor on the loop gain at which the loop becomes unstable; it may be below 1
    phase_margin: float  # [rad]
    disk_margin: float  # balanced (S - T): a allows gain factors from (2 - a)/(2 + a) to its inverse
    crossover: float  # [rad/s], where the loop gain is 1
    bandwidth: float  # [rad/s], where T first falls 3 dB below 1
    sensitivity_peak: float  # largest |S|
    complementary_peak: float  # largest |T|

    @classmethod
    def of(cls, loop: "control.StateSpace") -> "Margins":
        """Return the margins of a stable `loop`."""
        from cranectl.design.linear_systems import loop_margins

        return loop_margins(loop)

    @property
    def modulus_margin(self) -> float:
        """Smallest distance of the loop's locus from -1."""
        return 1.0 / self.sensitivity_peak


class Origin(NamedTuple):
    """The file of a controller that belongs to no package. A log contains it, but never runs it."""

    reference: str  # name of the file as on the command line
    sha256: str  # of its content, hexadecimal
    source: str  # its content if it is a text, else empty

    @property
    def described(self) -> str:
        """The file and its digest as a phrase."""
        return f"{self.reference}, SHA-256 {self.sha256[: Provenance.DIGITS]}"


@dataclass(frozen=True)
class ControllerDesign:
    """Hold a controller with its settings, as runs and logs record it.

    Parameters
    ----------
    name : str
        Name of the controller.
    parameters : Mapping
        Values of the parameters that it declares, by name, each in the unit of its declaration.
    signals : tuple of Signal
        Signals of its own that it logs.
    origin : Origin or None
        The file that it comes from; None for a controller of a package.
    """

    name: str
    _: KW_ONLY
    parameters: Mapping[str, Value] = field(default_factory=dict, hash=False)
    signals: tuple[Signal, ...] = ()
    origin: Origin | None = None

    @property
    def groups(self) -> tuple[SignalGroup, ...]:
        """The signal groups that a run with this controller records, besides those of every run."""
        return SignalGroup.of_controller(self.name, self.signals)

    @property
    def record_width(self) -> int:
        """Number of columns of a run's record without those of its signal path."""
        return sum(map(len, SignalGroup.recorded(self.groups)))

    @property
    def axis_design(self) -> "Design | None":
        """The linear design of one axis of the load, or None for a controller without one."""
        return None

    @property
    def flat(self) -> "Design":
        """The linear design of one axis of the load; raises InputError for a controller without one."""
        if self.axis_design is None:
            from cranectl.design.family import CONTROLLERS

            raise InputError(
                f"'{self.name}' has no linear design of one axis of the load, on which this judgement rests",
                allowed=f"the flat family: {', '.join(CONTROLLERS)}",
                remedy="judge it by simulation: cranectl ladder, cranectl campaign",
            )
        return self.axis_design

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        signals = [[s.name, s.symbol, s.unit, s.description] for s in self.signals]
        plain = {"name": self.name, "parameters": dict(self.parameters), "signals": signals}
        return plain if self.origin is None else {**plain, "origin": self.origin._asdict()}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "ControllerDesign":
        """Return what `to_json` has written; raise KeyError, TypeError or ValueError for other data."""
        if "gain" in data:
            return Design.from_json(data)
        signals = tuple(Signal(*map(str, signal)) for signal in data["signals"])
        origin = Origin(**data["origin"]) if "origin" in data else None
        parameters = dict(data["parameters"])
        return ControllerDesign(str(data["name"]), parameters=parameters, signals=signals, origin=origin)


@dataclass(frozen=True)
class Design(ControllerDesign):
    """Hold the linear design of one axis; all three axes use the same.

    v = z_d'''' + gain · (e, e', e'', e''') + v-bar, with e = z_d - z (3.47).

    Parameters
    ----------
    name : str
        Name of the controller.
    gain : ndarray, shape (4,)
        State feedback [1/s⁴, 1/s³, 1/s², 1/s].
    closed_loop_poles : ndarray
        Poles of one axis with its robustifier [1/s].
    margins : Margins
        Stability margins.
    robustifier : Robustifier
        The added dynamic controller.
    gamma, gamma_achieved : float or None
        Smallest norm of a robustifier of this kind (1/eps_max for loop shaping), and that of this one.
    stability_margin : float or None
        Margin eps of the normalised coprime factors, for loop shaping only.
    parameters : Mapping
        Parameters of the controller; the flat family has none.
    signals : tuple of Signal
        Signals that the controller logs itself.
    origin : Origin or None
        The file that the controller comes from.
    """

    gain: Array
    closed_loop_poles: NDArray[np.complex128]
    margins: Margins
    robustifier: Robustifier
    gamma: float | None = None
    gamma_achieved: float | None = None
    stability_margin: float | None = None

    def __post_init__(self) -> None:
        """Raise InconsistentError for norms that contradict each other."""
        InconsistentError.check_ascending(
            ("gamma, the smallest", self.gamma), ("gamma achieved", self.gamma_achieved)
        )

    @property
    def groups(self) -> tuple[SignalGroup, ...]:
        """The signal groups of the flat tracker, which has z'' and above, v and zeta."""
        return SignalGroup.of_flat_tracker(self.robustifier.sampled_order)

    @property
    def axis_design(self) -> "Design":
        """The design itself."""
        return self

    def open_loop(self) -> "control.StateSpace":
        """Return the loop of one axis cut at v: four integrators, state feedback and robustifier."""
        from cranectl.design.linear_systems import open_loop

        return open_loop(self.gain, self.robustifier.system())

    def inner_loop(self) -> "control.StateSpace":
        """Return one axis with its state feedback alone, from v-bar to z."""
        from cranectl.design.linear_systems import inner_loop

        return inner_loop(self.gain)

    def with_gain(self, gain: Array) -> "Design":
        """Return this design with another state feedback (4,); raise InputError if its loop is unstable."""
        from cranectl.design.linear_systems import closed_loop_poles

        changed = replace(self, gain=gain)
        loop = changed.open_loop()
        poles = closed_loop_poles(loop)
        fastest = poles.real.max()
        if not fastest < 0.0:
            raise InputError(
                f"unstable with the gains {', '.join(f'{k:g}' for k in gain)}: a pole at {fastest:.3g} 1/s",
                allowed="gains that put all poles of the closed loop to the left",
                remedy="change k3, k2, k1, k0 in this order when raising them, or all at once",
            )
        return replace(
            changed,
            name=f"{self.name.removesuffix(BY_HAND)}{BY_HAND}",
            closed_loop_poles=poles,
            margins=Margins.of(loop),
            gamma=None,
            gamma_achieved=None,
            stability_margin=None,
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain data, with poles as [real, imaginary]."""
        return {
            "name": self.name,
            "gain": self.gain.tolist(),
            "closed_loop_poles": [[pole.real, pole.imag] for pole in self.closed_loop_poles.tolist()],
            "gamma": self.gamma,
            "gamma_achieved": self.gamma_achieved,
            "stability_margin": self.stability_margin,
            "margins": asdict(self.margins),
            "robustifier": self.robustifier.to_json(),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Design":
        """Return what `to_json` has written; raise KeyError, TypeError or ValueError for other data."""
        poles = np.array([complex(*pole) for pole in data["closed_loop_poles"]])
        return cls(
            **{
                **data,
                "gain": np.array(data["gain"], dtype=float).reshape(4),
                "closed_loop_poles": poles,
                "margins": Margins(**data["margins"]),
                "robustifier": Robustifier.from_json(data["robustifier"]),
            }
        )


def loop_matrices(gain: Array, a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array, Array]:
    """Return A, B, C of the loop cut at v: from v by z'''' = v to gain · (z, z', z'', z''') + robustifier z.

    The matrices of the robustifier have the shapes (n, n), (n, 1), (1, n), (1, 1).
    """
    n = len(a)
    return (
        np.block([[CHAIN_A, np.zeros((4, n))], [b @ np.eye(4)[:1], a]]),
        np.vstack([CHAIN_B, np.zeros((n, 1))]),
        np.hstack([np.asarray(gain).reshape(1, 4) + d @ np.eye(4)[:1], c]),
    )
