"""Each erratum of docs/thesis/errata.md: the printed form fails, and the right form passes."""

import re

import numpy as np

from cranectl.model.flatness import state_and_input
from tests.conftest import ROOT
from validation.thesis.errata import chapter_2, chapter_3, chapter_4, chapter_5  # noqa: F401, they register
from validation.thesis.errata.registry import ERRATA, G, max_difference


def test_printed_forms_fail_and_corrected_forms_pass() -> None:
    for name, erratum in ERRATA.items():
        printed, right = erratum()
        assert printed > 1e-3, name
        assert right < 1e-9, name


def test_table_contains_exactly_the_checked_errata() -> None:
    page = (ROOT / "docs" / "thesis" / "errata.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| \*\*(.+?)\*\* \|", page, re.MULTILINE)
    assert listed == list(ERRATA)


def test_3_38_agrees_with_the_order_of_3_21() -> None:
    """The even states are the rates of the odd ones, unlike in (3.37)."""
    rng = np.random.default_rng(2)
    coefficients = 0.1 * rng.normal(size=(3, 8))
    coefficients[:, 0] += [1.0, 0.8, -0.7]
    axes = [np.polynomial.Polynomial(c) for c in coefficients]

    def state(t: float) -> np.ndarray:
        flat = np.array([axis.deriv(k)(t) if k else axis(t) for k in range(5) for axis in axes])
        out = np.zeros(10)
        state_and_input(flat, G, out, np.zeros(3))
        return out

    step = 1e-5
    rates = (state(step)[0::2] - state(-step)[0::2]) / (2 * step)
    assert max_difference(rates, state(0.0)[1::2]) < 1e-8
