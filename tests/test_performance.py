"""Parts of the performance measurements that no other test runs still work with the package."""

import pytest

from tests.conftest import ROOT


def test_the_cost_of_a_result_row_can_be_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "validation" / "performance"))
    import scaling

    assert [figure.value > 0.0 for figure in scaling.measure_result_costs(1)] == [True, True]
