"""`cranectl benchmark`."""

from cranectl.cli.benchmark.report import report_benchmark
from cranectl.cli.benchmark.run import run_benchmark
from cranectl.cli.command import CommandGroup

HELP = """Measure laws on the same cranes, by rules that favour none.

A benchmark is a TOML file: laws, scenarios, sets of cranes, plants. Each law on each of them is a campaign.
"""

benchmark_command = CommandGroup("benchmark", [run_benchmark, report_benchmark], help=HELP)
