import numpy as np
import pytest

from cranectl.reference.time_law import REST_DERIVATIVES, evaluate


@pytest.mark.parametrize(("name", "rest"), REST_DERIVATIVES.items())
def test_goes_from_rest_to_rest(name: str, rest: int) -> None:
    ends = evaluate(name, np.array([0.0, 1.0]))
    assert ends[0].tolist() == [0.0, 1.0]
    assert ends[1 : rest + 1] == pytest.approx(np.zeros((rest, 2)), abs=1e-12)
    if rest < 4:
        assert abs(ends[rest + 1]).min() > 1.0, "the first free derivative jumps"


def test_are_the_known_polynomials() -> None:
    tau = np.linspace(0.0, 1.0, 101)
    assert evaluate("degree-5", tau)[0] == pytest.approx(10 * tau**3 - 15 * tau**4 + 6 * tau**5, abs=1e-14)
    nine = 126 * tau**5 - 420 * tau**6 + 540 * tau**7 - 315 * tau**8 + 70 * tau**9
    assert evaluate("degree-9", tau)[0] == pytest.approx(nine, abs=1e-13)


@pytest.mark.parametrize("name", REST_DERIVATIVES)
def test_is_monotone(name: str) -> None:
    assert (evaluate(name, np.linspace(0.0, 1.0, 1001))[1] >= -1e-12).all()
