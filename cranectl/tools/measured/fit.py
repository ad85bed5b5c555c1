"""Keep what a verdict needs of an identification, in a file beside the rig."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cranectl.scenario import RigFile, RigParameters
from cranectl.simulate import Run
from cranectl.support import JSON, Array, InputError
from cranectl.tools.measured.identification import Identification, OpenNumber
from cranectl.tools.measured.identity import Trace, fingerprint
from cranectl.tools.measured.replay import Replay
from cranectl.tools.measured.uncertainty import Errors, root_of
from cranectl.tools.measured.unknowns import rig_with

FIT_ENDING = "-fit.json"


@dataclass(frozen=True)
class Fit:
    """What a verdict needs of an identification."""

    rig: RigParameters
    replay: Replay
    values: Mapping[str, float]
    known: Array  # covariance from noise and steps of the encoders (P, P)
    spread: Array  # covariance from the spread between runs (P, P)
    left_open: tuple[OpenNumber, ...]
    runs: int
    converged: bool
    used: tuple[Trace, ...]  # readings of the runs to which it was fitted

    @property
    def errors(self) -> Errors:
        """What is not known of the numbers."""
        left_open = {n.name: {n.name: n.scale, **n.compensation} for n in self.left_open}
        return Errors(tuple(self.values), root_of(self.known), root_of(self.spread), self.runs - 1, left_open)

    @staticmethod
    def text(result: Identification, runs: Sequence[Run]) -> str:
        """Return the file that keeps an identification for verdicts."""
        kept = {
            "replay": result.replay,
            "values": {estimate.name: estimate.value for estimate in result.estimates},
            "known": result.known.tolist(),
            "spread": result.spread.tolist(),
            "left_open": [vars(number) for number in result.left_open],
            "runs": result.runs,
            "converged": result.converged,
            "misfits": result.misfits,
            "used_readings": [fingerprint(run) for run in runs],
        }
        return json.dumps(kept, indent=1) + "\n"

    @staticmethod
    def path(rig: Path) -> Path:
        """Return the file of the identification that belongs to a rig file."""
        return rig.with_name(rig.stem + FIT_ENDING)

    @staticmethod
    def read(rig: Path) -> "Fit":
        """Return the identification of the rig in the file `rig`; raise InputError if there is none."""
        path = Fit.path(rig)
        try:
            kept = JSON.parse(path.read_text(encoding="utf-8"), str(path))
            values = dict(kept["values"])
            known, spread = (np.array(kept[name], dtype=np.float64) for name in ("known", "spread"))
            if not known.shape == spread.shape == (len(values),) * 2:
                raise ValueError("covariance of another size")
            return Fit(
                rig=rig_with(RigFile.load(rig), values),
                replay=kept["replay"],
                values=values,
                known=known,
                spread=spread,
                left_open=tuple(OpenNumber(**number) for number in kept["left_open"]),
                runs=int(kept["runs"]),
                converged=bool(kept["converged"]),
                used=tuple(map(Trace.recalled, kept["used_readings"])),
            )
        except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
            raise InputError(
                f"cannot read {path}, what is known of how exact {rig} is: {error}",
                allowed="a rig of `cranectl identify`, with the files beside it",
                remedy=f"identify the crane again, with --out {rig}",
            ) from None
