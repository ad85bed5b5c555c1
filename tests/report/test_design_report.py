"""Designs: multiple poles are told as such, several designs in one table and on one sheet."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.report.design import distinct_poles


@pytest.mark.parametrize("true", [(-3, -3, -4, -4), (-2.5,) * 4, (-0.1, -8, -8, -8), (-1 + 2j, -1 - 2j) * 2])
def test_multiple_poles_are_found_in_what_rounding_leaves_of_them(true: tuple[complex, ...]) -> None:
    companion = np.diag(np.ones(3), 1)
    companion[3] = -np.poly(true)[:0:-1].real
    computed = np.linalg.eigvals(companion)
    assert len(set(computed.tolist())) == 4
    found = {complex(round(pole.real, 6), round(pole.imag, 6)): m for pole, m in distinct_poles(computed)}
    assert found == Counter(map(complex, true))
    assert all(pole.imag == 0.0 or abs(pole.imag) > 1.0 for pole, _ in distinct_poles(computed))


def test_poles_that_nearly_coincide_are_several() -> None:
    poles = np.array([-3.0, -3.00003, -5.0 + 1e-4j, -5.0 - 1e-4j])
    assert sorted(distinct_poles(poles), key=lambda each: each[0].imag) == [
        (pole, 1) for pole in sorted(poles.tolist(), key=lambda pole: pole.imag)
    ]


@pytest.mark.usefixtures("in_empty_directory")
def test_several_designs_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    poles = 'design.poles=["-3+1j", "-3-1j", -4, -4]'
    names = ["pole-placement", "lqr+hinf"]
    assert main(["design", *names, "--set", poles, "--plot", "both.svg", "--json", "both.json"]) == 0
    out = capsys.readouterr().out
    assert "-4 (twice)" in out
    assert "-255.1" in out
    assert [each["name"] for each in json.loads(Path("both.json").read_text())["designs"]] == names
    assert {*names} <= {
        *Path("both.svg").read_text().replace("<!-- ", "\n").replace(" -->", "\n").split("\n")
    }
    assert main(["design", "lqr", "pid"]) == 2
    assert "the flat family" in capsys.readouterr().err
