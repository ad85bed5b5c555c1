"""Values with the prefixes of their units."""

import math

import pytest

from cranectl.support.trees import Tree
from cranectl.support.units import Quantity


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (0.0123456, "m", "12.3 mm"),
        (0.00099999, "m", "1.00 mm"),
        (-3.05e-7, "m", "-305 nm"),
        (4.2e-15, "m", "0.00420 pm"),
        (4.2e-17, "m", "4.20 · 10⁻¹⁷ m"),
        (1234.0, "m", "1234 m"),
        (123.4, "m", "123 m"),
        (196133.0, "N", "196 kN"),
        (2e-5, "rad/s²", "20.0 µrad/s²"),
        (2e-5, "°", "2.00 · 10⁻⁵°"),
        (0.0, "m", "0.00 m"),
        (-0.0, "m", "0.00 m"),
        (math.nan, "m", "nan m"),
        (-math.inf, "N", "-inf N"),
        (0.5, "mm", "0.500 mm"),
        (12e-3, "kN", "0.0120 kN"),
    ],
)
def test_a_value_is_told_with_the_prefix_of_its_unit(value: float, unit: str, expected: str) -> None:
    assert Quantity(value, unit).text() == expected


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        (600000.0, "600000"),
        (1234567.5, "1234567.5"),
        (math.pi / 8192, "0.000383495"),
        ([1e9, -4.29e-5, -0.0], "[1e9, -4.29e-5, 0]"),
        (math.nan, "nan"),
        (3, "3"),
        (None, "null"),
        ({"force": [1.0]}, '{"force": [1.0]}'),
        ("1.0", "1.0"),
    ],
)
def test_a_setting_is_told_with_the_digits_that_it_needs(setting: object, expected: str) -> None:
    assert Tree(setting).text() == expected


def test_a_column_has_the_unit_of_its_largest_value() -> None:
    assert [Quantity(value, "m").scale() for value in (0.4, 40.0, 0.0)] == [
        (1e3, "mm"),
        (1.0, "m"),
        (1.0, "m"),
    ]


@pytest.mark.parametrize(
    ("value", "text", "with_unit"),
    [
        (2.24e-3, "2.2e-03", "2.24 mm"),
        (2.5e-9, "2.5e-09", "2.50 nm"),
        (9.9e-10, "< 1e-09", "< 1 nm"),
        (1.7e-12, "< 1e-09", "< 1 nm"),
        (0.0, "< 1e-09", "< 1 nm"),
        (math.nan, "nan", "nan m"),
    ],
)
def test_digits_of_rounding_are_not_shown(value: float, text: str, with_unit: str) -> None:
    """They change with the processor."""
    assert (Quantity(value).si_difference(), Quantity(value, "m").difference()) == (text, with_unit)
