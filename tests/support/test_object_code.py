"""An object file computes what the compiled function computes, in a program that has no Python."""

import math
import subprocess
from pathlib import Path
from typing import Any

import pytest
from numba import types

from cranectl.support.jit import jit, jit_object
from cranectl.support.packed import array_at

POINTER: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
MAIN = """
#include <stdint.h>
#include <stdio.h>

int64_t tried(double *numbers, int64_t places);

int main(void)
{
    double numbers[2] = {0.7, 2.0};
    const long long good = tried(numbers, 2), failed = tried(numbers, 0);
    printf("%lld %lld %a %a", good, failed, numbers[0], numbers[1]);
    return 0;
}
"""


@jit
def swing(numbers):  # type: ignore[no-untyped-def]
    """Change two numbers by functions of C's library."""
    numbers[0] = math.sin(numbers[0]) * math.tanh(numbers[1])
    numbers[1] = math.cos(numbers[0]) ** 1.5


def tried(pointer, places):  # type: ignore[no-untyped-def]
    """Raise an exception, or change two numbers."""
    if places < 2:
        raise ValueError("too few")
    numbers = array_at(pointer, 2)
    for _ in range(places):
        swing(numbers)
    return 5


def needing(pointer, places):  # type: ignore[no-untyped-def]
    """Print, which only Python can do."""
    print(array_at(pointer, 2)[0], places)
    return 0


def test_a_program_without_python_gets_the_same_bits_and_a_failure_code(tmp_path: Path) -> None:
    (tmp_path / "tried.o").write_bytes(jit_object(tried, "tried", (POINTER, types.int64)))
    (tmp_path / "main.c").write_text(MAIN, encoding="utf-8")
    subprocess.run(["cc", "-o", "main", "main.c", "tried.o", "-lm"], cwd=tmp_path, check=True)
    a, b = 0.7, 2.0
    for _ in range(2):
        a = math.sin(a) * math.tanh(b)
        b = math.cos(a) ** 1.5
    printed = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout.split()
    assert printed[:2] == ["5", "-1"]
    assert [float.fromhex(text) for text in printed[2:]] == [a, b]


def test_other_libraries_cannot_see_its_function(tmp_path: Path) -> None:
    (tmp_path / "tried.o").write_bytes(jit_object(tried, "tried", (POINTER, types.int64)))
    command = ["cc", "-shared", "-o", "tried.so", "tried.o", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    shown = subprocess.run(["nm", "-D", "tried.so"], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert "tried" not in shown.stdout
    assert "Py" not in shown.stdout


def test_a_function_that_needs_python_is_refused() -> None:
    with pytest.raises(TypeError, match=r"needs .*Py"):
        jit_object(needing, "needing", (POINTER, types.int64))


def test_the_same_function_gives_the_same_bytes() -> None:
    first, second = (jit_object(tried, "tried", (POINTER, types.int64)) for _ in range(2))
    assert first == second
