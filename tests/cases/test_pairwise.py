"""Every plant against every other: what is farthest apart, and how much of it is their steps."""

import json

import pytest

from cranectl.cases.case import make_case
from cranectl.cases.pairwise import convergence, energy_drift
from cranectl.cli.main import main
from cranectl.planning import load_scenario

PLANTS = ["--plants", "analytic,elastic,mujoco"]


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    folder = tmp_path_factory.mktemp("pairs")
    files = [f"--json={folder / 'pairs.json'}", f"--report={folder / 'page.html'}", "--out", str(folder)]
    scenarios = ["near-slack", "fixed-position"]
    laws = ["--controller", "lqr", "--controller", "lqr+hinf", "--drive", "all", "--keep", "none"]
    assert main(["validate", *scenarios, *laws, *PLANTS, "--pairwise", *files]) == 0
    page = (folder / "page.html").read_text()
    return {**json.loads((folder / "pairs.json").read_text()), "page": page}


def test_all_pairs_are_told_with_the_worst_of_their_cases(told: dict[str, object]) -> None:
    pairs = {(p["drive"], p["plant"], p["reference"]): p for p in told["pairwise"]["pairs"]}
    assert len(pairs) == 9
    for (drive, plant, reference), pair in pairs.items():
        assert (pair["cases"], pair["failed"], pair["not_judged"]) == (4, 0, 0)
        worst = max(
            a["max_load_error_m"] for a in told["agreements"] if (a["drive"], a["plant"]) == (drive, plant)
        )
        if reference == "mujoco":
            assert pair["load_m"] == worst
            assert pair["scenario"] == "near-slack"
    # Two derivations that share nothing but the rig leave rounding; the engine's RK4 leaves 1e-11 to 1e-8.
    assert pairs["force", "analytic", "elastic"]["load_m"] < 1e-13
    assert pairs["velocity", "analytic", "elastic"]["load_m"] < 1e-11
    assert pairs["velocity", "elastic", "mujoco"]["load_m"] < 1e-8
    assert 'id="pairs"' in told["page"]


def test_each_plant_is_shown_with_its_own_steps(told: dict[str, object]) -> None:
    alone = {(p["plant"], p["drive"]): p for p in told["pairwise"]["plants"]}
    assert len(alone) == 9
    assert alone["mujoco", "velocity"]["order"] == pytest.approx(4.0, abs=0.1)
    for drive in ("ideal", "velocity", "force"):
        assert alone["elastic", drive]["step_error_m"] < 1e-11
        assert alone["elastic", drive]["energy_drift"] < 1e-13 < alone["mujoco", drive]["energy_drift"] < 1e-9


def test_long_steps_show_their_order() -> None:
    long = load_scenario("fast-diagonal", overrides=["control.period=0.02", "control.physics_step=0.02"])
    for plant, order in (("elastic", 5.0), ("mujoco", 4.0)):
        error, found = convergence(plant, make_case(long, controller="lqr", drive="velocity"))
        assert error > 1e-6
        assert order - 0.5 < found < order + 1.2  # coarse steps flatter
    assert energy_drift("mujoco", long) > 100.0 * energy_drift("mujoco", load_scenario("fast-diagonal"))
