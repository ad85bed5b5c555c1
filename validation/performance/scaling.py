"""Compute the costs of a million and a thousand million runs from measurements. Part of `performance.py`."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from cranectl.campaign.definition import Batch
from cranectl.campaign.results import Store
from cranectl.campaign.table import read_part, write_part
from cranectl.campaign.workers import run_batches
from validation.performance.campaign_rates import HEAVY, MEMORY, RATE, RESULT, campaign_of
from validation.performance.figures import Measurement, summarise, time_alternately

PART_ROWS = 977  # rows of a part, in a campaign of a million runs
# [s] of scheduler, client and worker; measured with 1024 empty batches on two workers and two busy cores
BATCH_OVERHEAD = 0.013
BATCH_KB, ROW_KB = 2.0, 0.8  # sent for a batch, and for each of its rows
RUN_COUNTS = (10**6, 10**9)

WRITE, READ = "writing a row of a result", "reading and checking a row"

TEXT = """
## A million runs, a thousand million

This table is computed from the measurements above, for runs of 25 s on MuJoCo with `{controller}`
and without effects. A batch sends {batch_kb:g} kB and {row_kb:g} kB per row. Scheduler and client
need {batch_ms:g} ms per batch ([campaigns](../how-to/campaigns.md#cluster)).

{table}

A million runs exceed no limit. The first limit would be memory: summary and report read a whole
result, which takes {memory:.1f} kB per run.

A thousand million runs meet these limits, in this order:

1. A campaign has at most 1 000 000 runs. Run a thousand campaigns with different seeds. They share
   nothing, so they can run on any machine.
2. Summary and report read a whole result into memory. Beyond some millions of runs, query the parts
   directly (DuckDB, Polars). You may add the failures of campaigns with different seeds.
3. A Latin hypercube is a permutation of all samples. `monte-carlo` and `sobol` draw each block
   separately.
4. One client writes all parts, in {write:.0f} µs per row. One scheduler hands out {rate:.0f}
   batches per second. With batches of 1000 runs they serve about {cores:,.0f} cores. One campaign
   for every thousand cores stays far below that.
5. Storage and network are no limits: a core produces {network:.1f} kB/s.
"""


def measure_result_costs(repeats: int) -> list[Measurement]:
    """Measure writing and reading a row, in a part as large as those of a million runs."""
    campaign = campaign_of("lqr", "analytic")
    ((_, (row,)),) = run_batches(campaign, [Batch("analytic", "lqr", 0, 1)])
    batch = Batch("analytic", "lqr", 0, PART_ROWS)
    rows = [row | {"sample": k} for k in range(PART_ROWS)]
    with tempfile.TemporaryDirectory() as folder, Store.open(campaign, Path(folder)) as store:
        path = Path(folder) / "part.parquet"
        times = time_alternately(
            {
                "write": lambda: write_part(path, campaign, store.origin, batch, rows),
                "read": lambda: read_part(path, campaign, [store.origin], batch),
            },
            repeats,
        )
    return [
        summarise(WRITE, [t / PART_ROWS * 1e6 for t in times["write"]], "µs"),
        summarise(READ, [t / PART_ROWS * 1e6 for t in times["read"]], "µs"),
    ]


def scaling_section(measurements: Sequence[Measurement]) -> str:
    """Return the section of the page about large campaigns, in Markdown."""
    value = {measurement.name: measurement.value for measurement in measurements}
    core_s = 2.0 / value[RATE]  # core seconds of a run
    memory = (value[MEMORY.format("100 000")] - value[MEMORY.format("10 000")]) * 1e6 / 9e4
    size = value[RESULT]
    network_kb = ROW_KB + BATCH_KB / PART_ROWS  # of a run
    lines = ["| measured | 10⁶ runs | 10⁹ runs |", "|---|---|---|"]
    rows = {
        "core hours": [n * core_s / 3600.0 for n in RUN_COUNTS],
        "hours on 2 cores": [n * core_s / 3600.0 / 2.0 for n in RUN_COUNTS],
        "minutes on 1000 cores": [n * core_s / 60.0 / 1000.0 for n in RUN_COUNTS],
        "result [GB]": [n * size / 1e9 for n in RUN_COUNTS],
        "network traffic [GB]": [n * network_kb / 1e6 for n in RUN_COUNTS],
        "memory to read the result [GB]": [n * memory / 1e9 for n in RUN_COUNTS],
        "writing by one client [h]": [n * value[WRITE] * 1e-6 / 3600.0 for n in RUN_COUNTS],
        "distribution by one scheduler [h]": [n / PART_ROWS * BATCH_OVERHEAD / 3600.0 for n in RUN_COUNTS],
    }
    lines += [f"| {name} | {a:.2g} | {b:,.3g} |" for name, (a, b) in rows.items()]
    serial_s = max(value[WRITE] * 1e-6, BATCH_OVERHEAD / PART_ROWS)  # of client or scheduler for a run
    return TEXT.format(
        controller=HEAVY[0], batch_kb=BATCH_KB, row_kb=ROW_KB, batch_ms=1e3 * BATCH_OVERHEAD,
        table="\n".join(lines), memory=memory / 1e3, write=value[WRITE], rate=1.0 / BATCH_OVERHEAD,
        cores=core_s / serial_s, network=network_kb / core_s,
    )  # fmt: skip
