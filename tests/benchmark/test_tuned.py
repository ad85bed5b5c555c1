"""Laws of the benchmark are tuned as they are, by the rules as they are."""

import hashlib
from pathlib import Path

import pytest
from pyarrow import parquet

from cranectl.campaign.benchmark.rules import rules_of
from cranectl.campaign.benchmark.settings import Benchmark, benchmark_file, read_benchmark
from cranectl.campaign.benchmark.tuned import tuned_settings
from cranectl.campaign.benchmark.variables import variables_of
from cranectl.cli.benchmark.laws import benchmark_laws
from cranectl.support.documents import read_toml
from tests.conftest import ROOT

FILE = benchmark_file("literature")
TUNED = FILE.parent / "tuned"


@pytest.fixture(scope="module")
def benchmark() -> Benchmark:
    return read_benchmark("literature")


def test_its_rules_are_those_by_which_all_its_laws_were_tuned(benchmark: Benchmark) -> None:
    """A change of rules, metrics or a law's file asks for new numbers."""
    laws, rules = benchmark_laws(benchmark.laws, FILE, trust=False), rules_of(benchmark, FILE.parent)
    for law in laws:
        tuned_settings(TUNED, rules, law, 1.0)
    assert {path.stem for path in TUNED.glob("*.toml")} == set(laws)


def test_every_law_had_the_same_budget_and_every_point_is_there(benchmark: Benchmark) -> None:
    for law in benchmark_laws(benchmark.laws, FILE, trust=False):
        told, points = read_toml(TUNED / f"{law}.toml"), parquet.read_table(TUNED / f"{law}.parquet")
        cost = points["cost"].to_pylist()
        runs = told["runs"] // len(cost)
        candidates = benchmark.tuning.runs // runs if variables_of(law) else 1
        assert len(cost) == candidates, law
        assert told["seed"] == benchmark.tuning.seed
        best = {"untuned": cost[0], "half": min(cost[: max(1, candidates // 2)]), "full": min(cost)}
        assert told["cost"] == best
        found = points.slice(cost.index(best["full"]), 1).to_pylist()[0]
        assert told["parameters"] == {each.key: float(f"{found[each.key]:.4g}") for each in variables_of(law)}


@pytest.mark.parametrize(
    ("path", "digest"),
    [
        (ROOT / "cranectl" / "controllers" / "lqr_offset_free.py", "aa14e3216072347e"),
        (TUNED / "lqr-offset-free.toml", "98cc468d8495511c"),
    ],
)
def test_our_law_and_its_numbers_are_those_of_the_commit_that_drew_the_cranes(
    path: Path, digest: str, benchmark: Benchmark
) -> None:
    """Whoever changes them draws other cranes, and has all laws judged on these."""
    assert hashlib.sha256(path.read_bytes()).hexdigest().startswith(digest)
    assert benchmark.seed == int("57cf443f1637e6b", 16)
