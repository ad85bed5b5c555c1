"""Parts of the measurements of performance that nothing else runs still fit the package."""

import pytest

from tests.conftest import ROOT


def test_what_a_row_of_a_result_costs_can_be_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "validation" / "performance"))
    import scaling

    assert [figure.value > 0.0 for figure in scaling.result_costs(1)] == [True, True]
