"""The tuned numbers of the benchmark belong to the present controllers and rules."""

import hashlib
import subprocess

import pytest
from pyarrow import parquet

from cranectl.campaign.benchmark.declared import variables_of
from cranectl.campaign.benchmark.settings import Benchmark, benchmark_file, read_benchmark
from cranectl.campaign.benchmark.trials import rules_of
from cranectl.campaign.benchmark.tuned import tuned_settings
from cranectl.cli.benchmark import measured_controllers
from cranectl.support.documents import leaves, parse_toml, read_toml
from cranectl.support.provenance import syntax_of
from tests.benchmark.nmpc import FOLDER
from tests.conftest import ROOT

FILE = benchmark_file("literature")
TUNED = FILE.parent / "tuned"
DRAWING_COMMIT = "57cf443f1637e6b"  # first 15 digits of its hash, from which the seed follows


@pytest.fixture(scope="module")
def benchmark() -> Benchmark:
    return read_benchmark("literature")


def test_controllers_were_tuned_by_present_rules(benchmark: Benchmark) -> None:
    """If rules, metrics or a controller's file change, new numbers are needed."""
    controllers, rules = measured_controllers(benchmark), rules_of(benchmark)
    for controller in controllers:
        tuned_settings(TUNED, rules, controller, 1.0)
    assert {path.stem for path in TUNED.glob("*.toml")} == set(controllers)


def test_controllers_had_equal_budgets_and_all_points_are_stored(benchmark: Benchmark) -> None:
    keys_by_controller = {
        controller: [variable.key for variable in variables_of(controller)]
        for controller in measured_controllers(benchmark)
    }
    compiled = FOLDER / "tuned"
    keys_by_controller["nmpc"] = list(read_toml(compiled / "nmpc.toml")["parameters"])
    for controller, keys in keys_by_controller.items():
        stem = (compiled if controller == "nmpc" else TUNED) / controller
        table, points = (
            read_toml(stem.with_suffix(".toml")),
            parquet.read_table(stem.with_suffix(".parquet")),
        )
        cost = points["cost"].to_pylist()
        runs = table["runs"] // len(cost)
        candidates = benchmark.tuning.runs // runs if keys else 1
        assert len(cost) == candidates, controller
        expected = (benchmark.tuning.seed, benchmark.tuning.runs, rules_of(benchmark))
        assert (table["seed"], table["budget_runs"], table["rules"]) == expected
        best = {"untuned": cost[0], "half": min(cost[: max(1, candidates // 2)]), "full": min(cost)}
        assert table["cost"] == best
        best_point = points.slice(cost.index(best["full"]), 1).to_pylist()[0]
        assert table["parameters"] == {key: float(f"{best_point[key]:.4g}") for key in keys}


def test_standings_name_the_numbers_that_end_at_a_bound(benchmark: Benchmark) -> None:
    """Within 2 % of the range of the search."""
    at_bounds = {}
    for controller in measured_controllers(benchmark):
        found = dict(leaves(read_toml(TUNED / f"{controller}.toml")["parameters"]))
        places = {
            variable.key.rpartition(f"{controller}.")[2].rpartition("loop_shaping.")[2].removeprefix("design."):
            variable._replace(start=found[variable.key]).start_position
            for variable in variables_of(controller)
        }  # fmt: skip
        ends = [[f"`{name}`" for name, at in places.items() if abs(at - end) < 0.02] for end in (0, 1)]
        if any(ends):
            at_bounds[f"`{controller}`"] = [", ".join(names) for names in ends]
    page = (ROOT / "docs" / "reference" / "standings.md").read_text(encoding="utf-8")
    rows = page.partition("| numbers at the upper bound |")[2].splitlines()[2:]
    shown = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows if row.startswith("|")]
    assert {name: ends for name, *ends in shown} == at_bounds


def test_own_controller_is_that_of_the_commit_that_drew_the_cranes(benchmark: Benchmark) -> None:
    """If they compute something else, new cranes must be drawn, and all controllers run again.

    Only names have changed since that commit: `make restamp` ran rows of the judged table again, and they
    were equal to the bit.
    """
    file, numbers = (
        "cranectl/controllers/lqr_offset_free.py",
        "validation/benchmark/tuned/lqr-offset-free.toml",
    )
    code, parameters = (ROOT / file).read_bytes(), read_toml(ROOT / numbers)["parameters"]
    assert hashlib.sha256(syntax_of(code)).hexdigest().startswith("7ad4a778193a20d5")
    assert list(parameters.values()) == [9.88, 4.0, 1.993, 2.462]
    assert benchmark.seed == int(DRAWING_COMMIT, 16)
    if file_at_commit(file):
        assert parse_toml(file_at_commit(numbers).decode(), numbers)["parameters"] == parameters
        assert str(benchmark.seed).encode() not in file_at_commit("validation/benchmark/literature.toml")


def file_at_commit(name: str) -> bytes:
    """Return the file at the commit that drew the cranes; empty without history."""
    shown = subprocess.run(
        ["git", "show", f"{DRAWING_COMMIT}:{name}"], cwd=ROOT, capture_output=True, check=False
    )
    return shown.stdout
