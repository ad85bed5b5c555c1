"""Arithmetic of series against closed forms, exact or to rounding."""

from math import cosh, factorial, sinh

import numpy as np
import pytest

from cranectl.reference.series import Series, square_root

A, B = Series([2.0, -3.0, 0.5, 4.0, -1.5]), Series([4.0, 1.0, -2.0, 0.25, 3.0])
ROUNDING = 1e-14


def product(*factors: list[float]) -> list[float]:
    """Return the product of polynomials, truncated to the length of the first."""
    result = np.ones(1)
    for factor in factors:
        result = np.convolve(result, factor)
    return result[: len(factors[0])].tolist()


def test_derivatives_become_coefficients_and_are_differentiated() -> None:
    values = [3.0, -5.0, 7.0, 11.0, -13.0]
    coefficients = Series.from_derivatives(values)
    assert coefficients == pytest.approx(
        [value / factorial(k) for k, value in enumerate(values)], rel=ROUNDING
    )
    assert coefficients.derivative(0) == coefficients
    for times in (1, 2, 3):
        rates = coefficients.derivative(times)
        assert rates == pytest.approx(Series.from_derivatives(values[times:]), rel=ROUNDING)


def test_sums_are_as_long_as_the_shorter_one() -> None:
    assert A + Series(B[:3]) == [6.0, -2.0, -1.5]
    assert A - Series(B[:3]) == [-2.0, -4.0, 2.5]


def test_a_number_is_a_constant() -> None:
    assert [2.5, *A[1:]] == A + 0.5
    assert [1.5, *A[1:]] == A - 0.5
    assert [-1.5, *(-A)[1:]] == 0.5 - A
    assert A * 2.0 == 2.0 * A == 2 * A == [4.0, -6.0, 1.0, 8.0, -3.0]
    changed = before = Series(A)
    changed += 0.5
    changed *= 2
    assert (changed, before) == ([5.0, -6.0, 1.0, 8.0, -3.0], A)
    assert Series(A[:2]).padded(3) == [2.0, -3.0, 0.0]


@pytest.mark.parametrize("length", [1, 2, 3, 5])
def test_products_quotients_and_roots_undo_each_other(length: int) -> None:
    a, b = Series(A[:length]), Series(B[:length])
    assert a * B == pytest.approx(product(a, b), rel=ROUNDING)
    assert product(A / b, b) == pytest.approx(a, rel=ROUNDING)
    assert product(b.sqrt(), b.sqrt()) == pytest.approx(b, rel=ROUNDING)
    assert b.sqrt()[0] == square_root(4.0) == 2.0
    assert square_root(np.array([9.0])).tolist() == [3.0]


def test_cosine_and_sine_are_those_of_complex_exponentials() -> None:
    """Compare with e^(i a) at a = a0 + a1 t + …, summed over its powers."""
    angle = Series([0.7, -1.3, 0.4, 0.9, -0.2])
    power, whole = np.array([1.0 + 0.0j, 0, 0, 0, 0]), np.zeros(5, dtype=complex)
    for k in range(5):
        whole += power / factorial(k)
        power = np.convolve(power, 1j * np.array([0.0, *angle[1:]]))[:5]
    whole *= np.exp(1j * angle[0])
    cosine, sine = angle.cos_sin()
    assert cosine == pytest.approx(whole.real.tolist(), abs=ROUNDING)
    assert sine == pytest.approx(whole.imag.tolist(), abs=ROUNDING)


class Symbol:
    """A number with functions of its own: those of an imaginary argument."""

    def __init__(self, value: float) -> None:
        self.value = value

    def cos(self) -> float:
        return cosh(self.value)

    def sin(self) -> float:
        return sinh(self.value)

    def sqrt(self) -> float:
        return 7.0 * self.value

    def __mul__(self, factor: float) -> float:
        return self.value * factor


def test_other_kinds_of_numbers_use_their_own_functions() -> None:
    assert Series([Symbol(0.5)]).cos_sin() == ([cosh(0.5)], [sinh(0.5)])
    assert square_root(Symbol(2.0)) == 14.0
