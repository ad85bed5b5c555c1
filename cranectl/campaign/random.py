"""Random numbers by counter: Philox keyed by seed and a label, so that each column has a stream of its own.

A parameter's values do not change when others are added or removed.
"""

import hashlib

import numpy as np
from numpy.typing import NDArray

PER_COUNT = 4  # numbers that Philox-4x64 gives for each value of its counter


def stream(seed: int, label: str, *, counter: int = 0) -> np.random.Philox:
    """The stream of `label`, from `counter` on."""
    digest = hashlib.blake2b(label.encode(), digest_size=8).digest()
    key = np.array([seed, int.from_bytes(digest, "little")], dtype=np.uint64)
    return np.random.Philox(key=key, counter=counter)


def uniform_block(seed: int, label: str, first: int, last: int) -> NDArray[np.float64]:
    """Numbers [first, last) of the stream of `label`, multiples of 2⁻⁵³ in [0, 1), shape (last - first,)."""
    skipped = first % PER_COUNT
    raw = stream(seed, label, counter=first // PER_COUNT).random_raw(last - first + skipped)
    return np.ldexp((raw[skipped:] >> np.uint64(11)).astype(np.float64), -53)
