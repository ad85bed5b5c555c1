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
from cranectl.support.documents import parse_toml, read_toml
from cranectl.support.provenance import syntax_of
from tests.benchmark.nmpc import FOLDER
from tests.conftest import ROOT

FILE = benchmark_file("literature")
TUNED = FILE.parent / "tuned"
DRAWN_BY = "57cf443f1637e6b"  # the first 15 digits of the commit


@pytest.fixture(scope="module")
def benchmark() -> Benchmark:
    return read_benchmark("literature")


def laws_of(benchmark: Benchmark) -> tuple[str, ...]:
    return measured_controllers(benchmark)


def test_its_rules_are_those_by_which_all_its_laws_were_tuned(benchmark: Benchmark) -> None:
    """A change of rules, metrics or a controller's file needs new numbers."""
    laws, rules = laws_of(benchmark), rules_of(benchmark)
    for controller in laws:
        tuned_settings(TUNED, rules, controller, 1.0)
    assert {path.stem for path in TUNED.glob("*.toml")} == set(laws)


def test_every_law_had_the_same_budget_and_every_point_is_there(benchmark: Benchmark) -> None:
    searched = {
        controller: [variable.key for variable in variables_of(controller)]
        for controller in laws_of(benchmark)
    }
    built = FOLDER / "tuned"
    searched["nmpc"] = list(read_toml(built / "nmpc.toml")["parameters"])
    for controller, keys in searched.items():
        stem = (built if controller == "nmpc" else TUNED) / controller
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


def test_our_law_and_its_numbers_are_those_of_the_commit_that_drew_the_cranes(benchmark: Benchmark) -> None:
    """A change of what they compute needs a new draw of cranes, on which all controllers are judged again.

    Only names have changed since that commit. `make restamp` showed it: rows of the judged table, run again,
    are equal to the bit.
    """
    file, numbers = (
        "cranectl/controllers/lqr_offset_free.py",
        "validation/benchmark/tuned/lqr-offset-free.toml",
    )
    code, parameters = (ROOT / file).read_bytes(), read_toml(ROOT / numbers)["parameters"]
    assert hashlib.sha256(syntax_of(code)).hexdigest().startswith("e575a43703eea441")
    assert list(parameters.values()) == [9.88, 4.0, 1.993, 2.462]
    assert benchmark.seed == int(DRAWN_BY, 16)
    if of_commit(file):
        assert parse_toml(of_commit(numbers).decode(), numbers)["parameters"] == parameters
        assert str(benchmark.seed).encode() not in of_commit("validation/benchmark/literature.toml")


def of_commit(name: str) -> bytes:
    """Return the file at the commit that drew the cranes; empty without history."""
    shown = subprocess.run(["git", "show", f"{DRAWN_BY}:{name}"], cwd=ROOT, capture_output=True, check=False)
    return shown.stdout
