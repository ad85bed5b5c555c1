"""Results of `performance.py`: the file that keeps them, performance.json, and the page that shows them."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from validation.performance.controller_times import LawTime, section
from validation.performance.figures import Figure
from validation.performance.scaling import scaling

DATA = Path(__file__).with_name("performance.json")
DIGITS = 5  # that are kept

HEAD = """# Performance

Measured by `validation/performance/performance.py`, written by `make docs`. Ratios are medians of
interleaved repeats in one process, so they hold on other machines; times are of the machine that measured
them, with two cores. Runs record every signal of every sample, campaigns keep metrics.

Bare steps are RK4 of 1 ms without effects, called from a compiled loop, without the engine's clock, which
cranectl takes away for all. They are of `models/crane.xml`; and of the model that runs take, which moves
alike to the bit, but is not drawn, nor searched for springs, dampers and constraints that it does not have.
Other ways to write the same closed loop (`validation/performance/other_implementations.py`) step the
model file, record nothing, and reach the same last state.

A log is measured against the library that writes MCAP, given the same messages as bytes. What cranectl adds
is a third of the time: a half of that makes the messages of the 3-D scene, the rest makes those of the
signals, checks that the runs agree with what is said of them, judges the pair, and reads the file back.

"""


def write_results(figures: Iterable[Figure], times: Iterable[LawTime], path: Path = DATA) -> None:
    """Write the file, a figure or controller a line."""
    parts = {"figures": figures, "controllers": times}
    lists = (f'"{name}": [\n{_lines(records)}\n]' for name, records in parts.items())
    path.write_text("{{{}}}\n".format(",\n".join(lists)), encoding="utf-8")


def _lines(records: Iterable[Figure] | Iterable[LawTime]) -> str:
    return ",\n".join(json.dumps(_rounded(asdict(each)), ensure_ascii=False) for each in records)


def _rounded(value: Any) -> Any:
    """Return a value of JSON with DIGITS digits of its floats, and without what is the default."""
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items() if each is not None and each is not False}
    if isinstance(value, tuple):
        return [_rounded(each) for each in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def read_results(path: Path = DATA) -> tuple[list[Figure], list[LawTime]]:
    """Return what `write_results` has written."""
    told = json.loads(path.read_text(encoding="utf-8"))
    times = [LawTime(**{**each, "sample": _figure(each["sample"])}) for each in told["controllers"]]
    return [_figure(each) for each in told["figures"]], times


def _figure(told: dict[str, Any]) -> Figure:
    return Figure(**{**told, "spread": tuple(told["spread"])})


def performance_page(figures: list[Figure], times: list[LawTime]) -> str:
    """Return the page in Markdown."""
    return HEAD + table(figures) + section(times) + scaling(figures)


def table(figures: Iterable[Figure]) -> str:
    """Return figures in Markdown, a row each."""
    lines = ["| measured | median | spread | limit |", "|---|---|---|---|"]
    for f in figures:
        limit = (
            ""
            if f.limit is None
            else f"{'≥' if f.at_least else '≤'} {f.limit:g}{'' if f.good else ' **missed**'}"
        )
        low, high = (f"{value:.3g}" for value in f.spread)
        lines.append(f"| {f.name} | {f.value:.3g} {f.unit} | {low} … {high} | {limit} |")
    return "\n".join(lines) + "\n"
