"""Settings of a user's benchmark that change nothing in any of its runs."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from cranectl.cli.idle import IdleSettings
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.support import Shipped
from cranectl.tools import benchmark as benchmarks

if TYPE_CHECKING:
    from cranectl.tools.benchmark.settings import Benchmark


def idle_in_benchmark(benchmark: "Benchmark", runs: Iterable[tuple[str, str, str]]) -> list[str]:
    """Say what of a user's benchmark changes nothing in any of its runs.

    `runs`: scenario of the benchmark, plant and controller of each.
    """
    lines: list[str] = []
    listed = list(runs)
    is_ours = benchmark.file.parent == Shipped.BENCHMARKS.folder
    for name, measured in () if is_ours else benchmark.scenarios.items():
        if uses := [
            (plant, benchmark.drive, controller) for scenario, plant, controller in listed if scenario == name
        ]:
            request = ScenarioRequest(
                benchmarks.scenario_source(benchmark, name), None, [*benchmark.set, *measured.set]
            )
            lines += IdleSettings.lines(request.load(), request, uses, unread=("log.*", "expected"))
    return lines
