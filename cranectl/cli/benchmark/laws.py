"""Laws of a benchmark: all of its file, or those that one names."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cranectl.cli.laws import opened
from cranectl.support import resources
from cranectl.support.errors import InputError

if TYPE_CHECKING:
    from cranectl.campaign.benchmark.settings import Benchmark


def measured_laws(named: Sequence[str], benchmark: "Benchmark", file: Path, trust: bool) -> tuple[str, ...]:
    """Names of the laws `named`, as `benchmark`, in `file`, names them or as ever; by default of all its."""
    if not named:
        return benchmark_laws(benchmark.laws, file, trust)
    return tuple(
        benchmark_laws([law], file, trust)[0] if law in benchmark.laws else opened(law) for law in named
    )


def benchmark_laws(laws: Iterable[str], file: Path, trust: bool) -> tuple[str, ...]:
    """Names of the laws of a benchmark's file, those in files opened; ours are, others' only by `trust`."""
    found = []
    is_ours = file.resolve().is_relative_to(resources.BENCHMARK_DIRECTORY.resolve())
    for law in laws:
        if {".", ":"} & set(law) and not trust and not is_ours:
            raise InputError(
                f"{file} names the law {law}, and no file runs code by itself",
                allowed="laws by name, and files named on the command line",
                remedy="if you know what is in it, add --trust, or name it: --controller PATH",
            )
        found.append(opened(law, file.parent))
    return tuple(found)
