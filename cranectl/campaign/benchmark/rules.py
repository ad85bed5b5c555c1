"""The rules of a benchmark have a digest: results by other rules are not compared."""

import hashlib
import inspect
import json
from pathlib import Path

import cranectl.metrics
from cranectl.campaign.benchmark.pieces import scenario_place
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.scenario.load import read_scenario
from cranectl.support.provenance import FINGERPRINT_DIGITS
from cranectl.support.syntax import syntax_of


def rules_of(benchmark: Benchmark, directory: Path) -> str:
    """Digest of all that decides a comparison but the laws and the seed.

    These are the benchmark's file in `directory`, its scenarios, their rigs, and the code of the metrics,
    without comments and docstrings.
    Raises InputError for a scenario that cannot be read.
    """
    scenarios = {}
    for name, each in benchmark.scenarios.items():
        scenario = read_scenario(scenario_place(each.file, directory))
        given = scenario.model_dump(mode="json", exclude_unset=True, exclude={"title"})
        scenarios[name] = [given, scenario.rig.model_dump(mode="json")]
    table = benchmark.model_dump(mode="json", exclude={"laws", "seed", "title"})
    text = json.dumps([table, scenarios], sort_keys=True)
    for path in sorted(Path(inspect.getfile(cranectl.metrics)).parent.glob("*.py")):
        text += syntax_of(path.read_bytes()).decode()
    return hashlib.sha256(text.encode()).hexdigest()[:FINGERPRINT_DIGITS]
