"""A traced number has the value of its expression, and no other function can take it."""

import math
from typing import Any

import numpy as np
import pytest

from cranectl.export.traced import Traced


def test_expressions_have_their_values() -> None:
    a, b = Traced(0.7, "a"), Traced(-1.3, "b")
    built: list[Any] = [-(a + b) * 2.0, 3.0 - a / b, np.float64(0.1) * a - 1, 1.0 / (b + 0.0), (5 + a) / 4.0]
    for number in built:
        assert eval(_in_python(number.text), {"a": 0.7, "b": -1.3, "f": float.fromhex}) == number.value
    assert len({number.value for number in built}) == len(built)
    of_arrays = np.array([a, 1.0, b]) / np.array([2.0, 4.0, 8.0])
    assert [getattr(number, "value", number) for number in of_arrays] == [0.35, 0.25, -1.3 / 8.0]


def _in_python(text: str) -> str:
    """Return C text with its numbers as Python has them."""
    return " ".join(
        f'f("{part}")' if "0x" in part else part
        for part in text.replace("(", "( ").replace(")", " )").split()
    )


def test_it_is_true_if_it_is_not_zero() -> None:
    assert Traced(0.1, "a")
    assert not Traced(0.0, "a")


@pytest.mark.parametrize("function", [math.sin, math.sqrt, float, lambda x: x**2, lambda x: x < 1.0, np.sqrt])
def test_other_functions_refuse_it(function: Any) -> None:
    with pytest.raises(TypeError):
        function(Traced(0.5, "a"))
