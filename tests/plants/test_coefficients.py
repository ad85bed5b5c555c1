"""The coefficients of our integrators are those of SciPy, to the last bit."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import DOP853, RK45

from cranectl.plants import dop853
from cranectl.plants.elastic import crane


@pytest.mark.parametrize(("own", "method"), [(dop853, DOP853), (crane, RK45)], ids=["order 8", "order 5"])
def test_coefficients_are_those_of_scipy(own: Any, method: Any) -> None:
    stages = method.n_stages
    assert stages == own.STAGES
    np.testing.assert_array_equal(own.A, method.A[:stages, :stages])
    np.testing.assert_array_equal(own.B, method.B)
