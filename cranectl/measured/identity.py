"""Tell measured runs apart by what was measured: names of files and texts of maps are no identity."""

import hashlib
from collections.abc import Sequence

import numpy as np

from cranectl.simulate import Run
from cranectl.support.errors import InputError

GRAIN = 1e-6  # [m, rad] below which two readings are the same: other units in a map round otherwise
PHASE = 0.381966  # of the grains, whose edges then lie beside all decimal numbers


def readings_digest(run: Run) -> str:
    """Return a digest of positions and angles of a measured run, and of the period of its samples.

    Commands do not count: a run is the same with another choice of mapped columns.
    """
    grains = np.floor(run.block("state")[:, 0::2] / GRAIN + PHASE).astype(np.int64)
    period = int(run.time_ns[1] - run.time_ns[0]) if len(run.time_ns) > 1 else 0
    return hashlib.sha256(f"{period} {grains.shape}".encode() + grains.tobytes()).hexdigest()


def check_all_differ(runs: Sequence[Run]) -> None:
    """Raise InputError if two of the runs have the same readings, which would count twice."""
    digests = [readings_digest(run) for run in runs]
    for k, digest in enumerate(digests):
        if (first := digests.index(digest)) < k:
            raise InputError(
                f"log {k + 1} has the same readings as log {first + 1}",
                allowed="logs of different runs, whose spread tells how exact the numbers are",
                remedy=f"leave out log {k + 1}",
            )
