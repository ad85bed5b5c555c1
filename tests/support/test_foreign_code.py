"""Code from outside may round and import as it likes; what comes after it does so as before."""

import ctypes
import platform
import sys

import numpy as np

from cranectl.support.foreign_code import contained, environment_kept, keeping_environment

UPWARD = {"x86_64": 0x800, "AMD64": 0x800, "aarch64": 0x400000, "arm64": 0x400000}[platform.machine()]
LIBRARY = ctypes.CDLL("libm.so.6" if platform.system() == "Linux" else None)
STEP = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)


def third() -> float:
    return float(np.float64(1.0) / np.float64(3.0))


def test_rounding_is_restored_after_a_block_and_a_step() -> None:
    nearest, seen = third(), []

    def step(*_: int) -> int:
        LIBRARY.fesetround(UPWARD)
        seen.append(third())
        return 7

    callback = STEP(step)
    address = ctypes.cast(callback, ctypes.c_void_p).value
    assert address is not None
    assert STEP(keeping_environment(address))(None, None, None, None, None) == 7
    after_step = third()
    with environment_kept():
        LIBRARY.fesetround(UPWARD)
        seen.append(third())
    assert after_step == third() == nearest
    assert all(number > nearest for number in seen)


def test_the_path_of_imports_is_restored() -> None:
    before = sys.path[:]
    with contained(), contained():
        sys.path.clear()
    assert sys.path == before
