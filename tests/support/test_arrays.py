"""Rounding to significant digits drops what differs between processors, and nothing else."""

import numpy as np
import pytest

from cranectl.support.arrays import CERTAIN_DIGITS, NEGLIGIBLE_PLACE, round_digits


def test_rounding_keeps_shape_and_digits_and_drops_the_rest() -> None:
    values = np.random.default_rng(4).uniform(1.0, 10.0, (4, 3)) * 10.0 ** np.arange(4)[:, np.newaxis]
    rounded = round_digits(values)
    assert rounded.shape == values.shape
    np.testing.assert_allclose(rounded, values, rtol=0.5 * 10.0 ** (1 - CERTAIN_DIGITS))
    assert (round_digits(values * (1.0 + 1e-14)) == rounded).all()
    assert (round_digits(rounded) == rounded).all()
    assert (rounded != values).all()
    negligible = 0.4 * 10.0**-NEGLIGIBLE_PLACE
    assert round_digits(np.array([1.0, negligible])).tolist() == [1.0, 0.0]
    assert round_digits(np.array([negligible])).tolist() == [pytest.approx(negligible)]
    for others in ([], [0.0, 0.0], [np.nan, 1.0], [np.inf, 1.0]):
        np.testing.assert_array_equal(round_digits(np.array(others)), others)
