"""The tuned numbers of the benchmark belong to the present controllers and rules."""

import ast
import hashlib
import shutil
from pathlib import Path

import pytest
from pyarrow import parquet

from cranectl.support.documents import TOML
from cranectl.support.provenance import Provenance
from cranectl.support.trees import Tree
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.declared import variables_of
from cranectl.tools.benchmark.settings import Benchmark, benchmark_file
from cranectl.tools.benchmark.trials import rules_of
from cranectl.tools.benchmark.tuned import TunedResult
from tests.benchmark.nmpc import FOLDER
from tests.conftest import ROOT
from validation.proofs.freeze import freeze, frozen_seed

FILE = benchmark_file("literature")
TUNED = FILE.parent / "tuned"
OWN_CODE = "bb70b4a03df70f50"  # of our controller when rules and numbers were frozen, without its imports


@pytest.fixture(scope="module")
def benchmark() -> Benchmark:
    return Benchmark.read("literature")


def test_controllers_were_tuned_by_present_rules(benchmark: Benchmark) -> None:
    """If rules, metrics or a controller's file change, new numbers are needed."""
    controllers, rules = measured_controllers(benchmark), rules_of(benchmark)
    for controller in controllers:
        TunedResult.settings(TUNED, rules, controller, 1.0)
    assert {path.stem for path in TUNED.glob("*.toml")} == set(controllers)


def test_controllers_had_equal_budgets_and_all_points_are_stored(benchmark: Benchmark) -> None:
    keys_by_controller = {
        controller: [variable.key for variable in variables_of(controller)]
        for controller in measured_controllers(benchmark)
    }
    compiled = FOLDER / "tuned"
    keys_by_controller["nmpc"] = list(TOML.read(compiled / "nmpc.toml")["parameters"])
    for controller, keys in keys_by_controller.items():
        stem = (compiled if controller == "nmpc" else TUNED) / controller
        table, points = (
            TOML.read(stem.with_suffix(".toml")),
            parquet.read_table(stem.with_suffix(".parquet")),
        )
        cost = points["cost"].to_pylist()
        runs = table["runs"] // len(cost)
        candidates = benchmark.tuning.runs // runs if keys else 1
        assert len(cost) == candidates, controller
        assert (table["seed"], table["rules"]) == (benchmark.tuning.seed, rules_of(benchmark))
        assert table["budget_runs"] == candidates * runs
        best = {"untuned": cost[0], "half": min(cost[: max(1, candidates // 2)]), "full": min(cost)}
        assert table["cost"] == best
        in_validation = table["validation"]["cost"]
        assert table["chosen"] == min(best, key=in_validation.__getitem__)
        point = points.slice(cost.index(best[table["chosen"]]), 1).to_pylist()[0]
        assert table["parameters"] == {key: float(f"{point[key]:.4g}") for key in keys}


def test_no_chosen_numbers_are_worse_than_the_published_ones_in_validation() -> None:
    for path in TUNED.glob("*.toml"):
        cost = (table := TOML.read(path))["validation"]["cost"]
        assert cost[table["chosen"]] <= cost["untuned"], path.stem


def test_standings_name_the_numbers_that_end_at_a_bound(benchmark: Benchmark) -> None:
    """Within 2 % of the range of the search; `test_standings.py` has those of the compiled `nmpc`."""
    at_bounds = {}
    for controller in measured_controllers(benchmark):
        found = dict(Tree(TOML.read(TUNED / f"{controller}.toml")["parameters"]).leaves())
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
    assert {name: ends for name, *ends in shown if name != "`nmpc`"} == at_bounds


def test_seed_of_judged_cranes_follows_from_rules_and_frozen_numbers(benchmark: Benchmark) -> None:
    assert benchmark.seed == frozen_seed(benchmark)
    assert freeze(only_check=True) == 0


def test_seed_changes_with_rules_and_numbers(tmp_path: Path) -> None:
    shutil.copytree(FILE.parent, tmp_path, dirs_exist_ok=True)

    def seed() -> int:
        return frozen_seed(Benchmark.read(str(tmp_path / FILE.name)))

    first = seed()
    assert first == frozen_seed(Benchmark.read("literature"))
    for name, old, new in (
        ("literature.toml", "variation_price = 0.02", "variation_price = 0.03"),
        ("tuned/pid.toml", "cost", "costs"),  # no number
        ("tuned/lqr.toml", '.0" = ', '.0" = 1'),
        ("nmpc/tuned/nmpc.toml", '"controller.', '"controller.x'),
    ):
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert old in text
        (tmp_path / name).write_text(text.replace(old, new), encoding="utf-8")
        assert (seed() == first) is (new == "costs"), name
        (tmp_path / name).write_text(text, encoding="utf-8")


def test_own_controller_is_that_of_the_freeze() -> None:
    """If it computes something else, new cranes must be drawn, and all controllers run again."""
    tree = ast.parse((ROOT / "cranectl" / "controllers" / "lqr_offset_free.py").read_bytes())
    tree.body = [node for node in tree.body if not isinstance(node, ast.Import | ast.ImportFrom)]
    code = Provenance.syntax_of(ast.unparse(tree).encode())
    assert hashlib.sha256(code).hexdigest().startswith(OWN_CODE)
