"""Records of a controller in a run: its settings and, for the flat family, its linear design."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, asdict, dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.signals import Signal, SignalGroup, controller_groups_of, flat_groups
from cranectl.support import FINGERPRINT_DIGITS, Array, check_ascending

if TYPE_CHECKING:
    import control

Value = float | str  # of a parameter: a number or a choice
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
        return f"{self.reference}, SHA-256 {self.sha256[:FINGERPRINT_DIGITS]}"


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
        return controller_groups_of(self.name, self.signals)

    @property
    def axis_design(self) -> "Design | None":
        """The linear design of one axis of the load, or None for a controller without one."""
        return None

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
        check_ascending(("gamma, the smallest", self.gamma), ("gamma achieved", self.gamma_achieved))

    @property
    def groups(self) -> tuple[SignalGroup, ...]:
        """The signal groups of the flat tracker, which has z'' and above, v and zeta."""
        return flat_groups(self.robustifier.sampled_order)

    @property
    def axis_design(self) -> "Design":
        """The design itself."""
        return self

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


def closed_loop_matrix(gain: Array, robustifier: Robustifier) -> Array:
    """Return the state matrix (4 + n, 4 + n) of one axis's error in the closed loop."""
    r = robustifier
    a, b, c = loop_matrices(gain, r.a, r.b.reshape(-1, 1), r.c.reshape(1, -1), np.array([[r.d]]))
    closed: Array = a - b @ c
    return closed
