"""Comparison of every plant with every other: largest differences, and convergence of each plant."""

import json

import pytest

from cranectl.cases import Case
from cranectl.cases.pairwise import convergence, energy_drift
from cranectl.cli.main import main
from cranectl.planning import load_scenario

PLANTS = ["--plants", "analytic,elastic,mujoco"]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    folder = tmp_path_factory.mktemp("pairs")
    files = [f"--json={folder / 'pairs.json'}", f"--report={folder / 'page.html'}", "--out", str(folder)]
    scenarios = ["near-slack", "fixed-position"]
    options = ["--controller", "lqr", "--controller", "lqr+hinf", "--drive", "all", "--keep", "none"]
    assert main(["validate", *scenarios, *options, *PLANTS, "--pairwise", *files]) == 0
    page = (folder / "page.html").read_text()
    return {**json.loads((folder / "pairs.json").read_text()), "page": page}


def test_every_pair_is_reported_with_its_worst_case(results: dict[str, object]) -> None:
    pairs = {(p["drive"], p["plant"], p["reference"]): p for p in results["pairwise"]["pairs"]}
    assert len(pairs) == 9
    for (drive, plant, reference), pair in pairs.items():
        assert (pair["cases"], pair["failed"], pair["not_judged"]) == (4, 0, 0)
        worst = max(
            a["max_load_error_m"] for a in results["agreements"] if (a["drive"], a["plant"]) == (drive, plant)
        )
        if reference == "mujoco":
            assert pair["load_m"] == worst
            assert pair["scenario"] == "near-slack"
    # Two independent derivations differ by rounding; the engine's RK4 differs by 1e-11 to 1e-8.
    assert pairs["force", "analytic", "elastic"]["load_m"] < 1e-13
    assert pairs["velocity", "analytic", "elastic"]["load_m"] < 1e-11
    assert pairs["velocity", "elastic", "mujoco"]["load_m"] < 1e-8
    assert 'id="pairs"' in results["page"]


def test_each_plant_is_reported_with_its_convergence(results: dict[str, object]) -> None:
    alone = {(p["plant"], p["drive"]): p for p in results["pairwise"]["plants"]}
    assert len(alone) == 9
    assert alone["mujoco", "velocity"]["order"] == pytest.approx(4.0, abs=0.1)
    for drive in ("ideal", "velocity", "force"):
        assert alone["elastic", drive]["step_error_m"] < 1e-11
        assert alone["elastic", drive]["energy_drift"] < 1e-13 < alone["mujoco", drive]["energy_drift"] < 1e-9


def test_long_steps_show_the_order_of_convergence() -> None:
    long = load_scenario("fast-diagonal", overrides=["control.period=0.02", "control.physics_step=0.02"])
    for plant, order in (("elastic", 5.0), ("mujoco", 4.0)):
        error, measured = convergence(plant, Case.of(long, controller="lqr", drive="velocity"))
        assert error > 1e-6
        assert order - 0.5 < measured < order + 1.2  # coarse steps overestimate the order
    assert energy_drift("mujoco", long) > 100.0 * energy_drift("mujoco", load_scenario("fast-diagonal"))
