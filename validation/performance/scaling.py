"""What a million and a thousand million runs take, from measured costs. Part of `performance.py`."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from cranectl.campaign.definition import Batch
from cranectl.campaign.results import open_store
from cranectl.campaign.table import read_part, write_part
from cranectl.campaign.workers import run_batches
from validation.performance.campaign_rates import HEAVY, MEMORY, RATE, RESULT, campaign_of
from validation.performance.figures import Figure, figure, interleaved

ROWS = 977  # of a part of a campaign of a million runs
BATCH_S = 0.013  # of scheduler, client and worker; 1024 empty batches, two workers on two busy cores
ORDER_KB, ROW_KB = 2.0, 0.8  # that travel for a batch, and for each of its rows
COUNTS = (10**6, 10**9)

WRITE, READ = "writing a row of a result", "reading and checking a row"

TEXT = """
## A million runs, a thousand million

Runs of 25 s on MuJoCo with `{controller}`, without effects of the engine, from the figures above. A batch
travels as {order:g} kB and {row:g} kB a row, and costs scheduler and client {batch:g} ms besides
([campaigns](../how-to/campaigns.md#cluster)).

{table}

A million runs break nothing. Memory would be first: summary and report read a whole result, {memory:.1f} kB a
run.

A thousand million, in the order in which it breaks:

1. A campaign ends at 1 000 000 runs. Run a thousand with a seed each: they share nothing, and can be on any
   machine.
2. Summary and report read a whole result into memory. Beyond some millions of runs, ask the parts directly
   (DuckDB, Polars); failures of campaigns that differ in their seeds add up.
3. A Latin hypercube is a permutation of all samples; `monte-carlo` and `sobol` draw any block by itself.
4. One client writes all parts, {write:.0f} µs a row, and one scheduler hands out {rate:.0f} batches a second:
   with batches of 1000 runs they keep about {cores:,.0f} cores busy. A campaign for every thousand cores
   stays far from that.
5. Storage and network do not matter: a core makes {network:.1f} kB/s.
"""


def result_costs(repeats: int) -> list[Figure]:
    """Measure the costs of a part as large as those of a million runs."""
    campaign = campaign_of("lqr", "analytic")
    ((_, (row,)),) = run_batches(campaign, [Batch("analytic", "lqr", 0, 1)])
    batch = Batch("analytic", "lqr", 0, ROWS)
    rows = [row | {"sample": k} for k in range(ROWS)]
    with tempfile.TemporaryDirectory() as folder, open_store(campaign, Path(folder)) as store:
        path = Path(folder) / "part.parquet"
        times = interleaved(
            {
                "write": lambda: write_part(path, campaign, store.origin, batch, rows),
                "read": lambda: read_part(path, campaign, [store.origin], batch),
            },
            repeats,
        )
    return [
        figure(WRITE, [t / ROWS * 1e6 for t in times["write"]], "µs"),
        figure(READ, [t / ROWS * 1e6 for t in times["read"]], "µs"),
    ]


def scaling(figures: Sequence[Figure]) -> str:
    """Return the plan of large campaigns from the figures of a benchmark."""
    value = {each.name: each.value for each in figures}
    core_s = 2.0 / value[RATE]
    memory = (value[MEMORY.format("100 000")] - value[MEMORY.format("10 000")]) * 1e6 / 9e4
    size = value[RESULT]
    lines = ["| measured | 10⁶ runs | 10⁹ runs |", "|---|---|---|"]
    rows = {
        "core hours": [n * core_s / 3600.0 for n in COUNTS],
        "hours on 2 cores": [n * core_s / 3600.0 / 2.0 for n in COUNTS],
        "minutes on 1000 cores": [n * core_s / 60.0 / 1000.0 for n in COUNTS],
        "result [GB]": [n * size / 1e9 for n in COUNTS],
        "through the network [GB]": [n * (ROW_KB + ORDER_KB / ROWS) / 1e6 for n in COUNTS],
        "memory to read it [GB]": [n * memory / 1e9 for n in COUNTS],
        "one client writes [h]": [n * value[WRITE] * 1e-6 / 3600.0 for n in COUNTS],
        "one scheduler hands out [h]": [n / ROWS * BATCH_S / 3600.0 for n in COUNTS],
    }
    lines += [f"| {name} | {a:.2g} | {b:,.3g} |" for name, (a, b) in rows.items()]
    per_run = max(value[WRITE] * 1e-6, BATCH_S / ROWS)
    return TEXT.format(
        controller=HEAVY[0], order=ORDER_KB, row=ROW_KB, batch=1e3 * BATCH_S, table="\n".join(lines),
        memory=memory / 1e3, write=value[WRITE], rate=1.0 / BATCH_S, cores=core_s / per_run,
        network=(ROW_KB + ORDER_KB / ROWS) / core_s,
    )  # fmt: skip
