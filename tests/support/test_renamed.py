"""Former names of public arguments."""

import inspect

import pytest

import cranectl
from cranectl.support.renamed import renamed_arguments


@renamed_arguments(former="present")
def double(*, present: float = 1.0) -> float:
    return 2.0 * present


def test_a_former_name_works_and_warns_the_caller() -> None:
    assert double(present=2.0) == 4.0
    with pytest.warns(DeprecationWarning, match="argument former of double is now present") as warned:
        assert double(former=3.0) == 6.0
    assert warned[0].filename == __file__
    former_names = {"known": "nominal", "law": "compiled_controller", "patience": "timeout"}
    values = (None, None, 600.0)
    for (former, present), value in zip(former_names.items(), values, strict=True):
        assert present in inspect.signature(cranectl.simulate_run).parameters
        with (
            pytest.warns(DeprecationWarning, match=f"{former} of simulate_run is now {present}"),
            pytest.raises(cranectl.InputError, match="ropes"),
        ):
            cranectl.simulate_run(cranectl.load_scenario("fixed-position"), drive="ropes", **{former: value})
