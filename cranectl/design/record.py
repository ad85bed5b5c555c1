"""What a design is, once computed: gains, achieved poles, margins, robustifier."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Robustifier:
    """A linear system from e to v-bar, the same for each axis, sampled, in real modal form.

    Block k: xi_k+ = state_matrix[k] xi_k + input_matrix[k] e, v-bar = sum output_matrix[k]·xi_k +
    feedthrough e. Shapes (n, 2, 2), (n, 2), (n, 2); a real pole fills half a block.
    """

    state_matrix: Array
    input_matrix: Array
    output_matrix: Array
    feedthrough: float

    @property
    def order(self) -> int:
        """Number of states per axis."""
        return 2 * len(self.state_matrix)

    def to_json(self) -> dict[str, Any] | None:
        """Plain data; None for the robustifier that does nothing."""
        if not self.order and not self.feedthrough:
            return None
        return {
            "state_matrix": self.state_matrix.tolist(),
            "input_matrix": self.input_matrix.tolist(),
            "output_matrix": self.output_matrix.tolist(),
            "feedthrough": self.feedthrough,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any] | None) -> "Robustifier":
        """Inverse of `to_json`."""
        if data is None:
            return NO_ROBUSTIFIER
        return cls(
            state_matrix=np.array(data["state_matrix"]).reshape(-1, 2, 2),
            input_matrix=np.array(data["input_matrix"]).reshape(-1, 2),
            output_matrix=np.array(data["output_matrix"]).reshape(-1, 2),
            feedthrough=float(data["feedthrough"]),
        )


NO_ROBUSTIFIER = Robustifier(np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros((0, 2)), 0.0)


@dataclass(frozen=True)
class Design:
    """A controller for the chain z'''' = v of one axis; all three axes use the same.

    v = z_d'''' + gain · (e, e', e'', e''') + v-bar, with e = z_d - z (3.47).
    """

    name: str
    gain: Array  # (4,) [1/s⁴, 1/s³, 1/s², 1/s]
    closed_loop_poles: NDArray[np.complex128]  # [1/s], eigenvalues of the continuous loop
    gain_margin: float  # factor on the loop gain that meets the stability limit; below 1: a reduction
    phase_margin: float  # [rad]
    modulus_margin: float  # smallest distance of the loop's locus from -1, 1 / max |S|
    crossover: float  # [rad/s], where the loop gain is 1
    robustifier: Robustifier

    def to_json(self) -> dict[str, Any]:
        """Plain data; poles as [real, imaginary]."""
        return {
            "name": self.name,
            "gain": self.gain.tolist(),
            "closed_loop_poles": [[pole.real, pole.imag] for pole in self.closed_loop_poles.tolist()],
            "gain_margin": self.gain_margin,
            "phase_margin": self.phase_margin,
            "modulus_margin": self.modulus_margin,
            "crossover": self.crossover,
            "robustifier": self.robustifier.to_json(),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Design":
        """Inverse of `to_json`; raises KeyError, TypeError or ValueError for other data."""
        poles = np.array([complex(*pole) for pole in data["closed_loop_poles"]])
        return cls(
            **{
                **data,
                "gain": np.array(data["gain"]),
                "closed_loop_poles": poles,
                "robustifier": Robustifier.from_json(data["robustifier"]),
            }
        )
