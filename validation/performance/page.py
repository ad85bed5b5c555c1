"""Write and read performance.json, the results of `performance.py`, and return them as a page."""

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from validation.performance.controller_times import ControllerTime, controllers_section
from validation.performance.figures import Measurement
from validation.performance.scaling import scaling_section

DATA = Path(__file__).with_name("performance.json")
DIGITS = 5  # of a stored number

HEAD = """# Performance

`validation/performance/performance.py` measures this page, and `make docs` writes it. The parts
that a row compares take turns in one process, and a ratio is the median over the turns. So ratios
hold on other machines. Times are those of one machine with two cores. Runs record every signal of
every sample; campaigns keep metrics.

Bare steps are steps of the engine alone: RK4 of 1 ms without effects, called from a compiled loop.
cranectl switches off the engine's clock everywhere, also for them. There are bare steps of two
models:

- the model file, `models/crane.xml`
- the model of runs. It moves equally to the bit, but has nothing to draw. The engine does not
  search it for springs, dampers and constraints that it does not have.

Other implementations of the same closed loop are in
`validation/performance/other_implementations.py`. They step the model file, record nothing, and
reach the same last state.

Writing a log is compared with the library that writes MCAP, which gets the same messages as bytes.
cranectl needs a third of the time for its own work. Half of that makes the messages of the 3-D
scene. The rest makes those of the signals, checks the runs against their description, compares the
pair, and reads the file back.

"""


def write_results(
    measurements: Iterable[Measurement], times: Iterable[ControllerTime], path: Path = DATA
) -> None:
    """Write the file, with one line for each measurement and controller."""
    parts = {"figures": measurements, "controllers": times}
    lists = (f'"{name}": [\n{_lines(records)}\n]' for name, records in parts.items())
    path.write_text("{{{}}}\n".format(",\n".join(lists)), encoding="utf-8")


def _lines(records: Iterable[Measurement] | Iterable[ControllerTime]) -> str:
    return ",\n".join(json.dumps(_round(asdict(record)), ensure_ascii=False) for record in records)


def _round(value: Any) -> Any:
    """Return a value of JSON with floats of DIGITS digits, and without None and False."""
    if isinstance(value, dict):
        return {key: _round(item) for key, item in value.items() if item is not None and item is not False}
    if isinstance(value, tuple):
        return [_round(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def read_results(path: Path = DATA) -> tuple[list[Measurement], list[ControllerTime]]:
    """Read a file of `write_results`."""
    content = json.loads(path.read_text(encoding="utf-8"))
    times = [
        ControllerTime(**{**record, "sample": _measurement(record["sample"])})
        for record in content["controllers"]
    ]
    return [_measurement(record) for record in content["figures"]], times


def _measurement(record: dict[str, Any]) -> Measurement:
    return Measurement(**{**record, "spread": tuple(record["spread"])})


def performance_page(measurements: list[Measurement], times: list[ControllerTime]) -> str:
    """Return the page in Markdown."""
    sections = (results_table(measurements), controllers_section(times), scaling_section(measurements))
    return HEAD + "".join(sections)


def results_table(measurements: Iterable[Measurement]) -> str:
    """Return a table in Markdown with a row for each measurement."""
    lines = ["| measured | median | spread | limit |", "|---|---|---|---|"]
    for m in measurements:
        limit = (
            ""
            if m.limit is None
            else f"{'≥' if m.at_least else '≤'} {m.limit:g}{'' if m.meets_limit else ' **missed**'}"
        )
        low, high = (f"{value:.3g}" for value in m.spread)
        lines.append(f"| {m.name} | {m.value:.3g} {m.unit} | {low} … {high} | {limit} |")
    return "\n".join(lines) + "\n"
