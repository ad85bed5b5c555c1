"""Compute the metrics of a run, from its whole record or block by block while it runs.

    accumulator = Accumulator(scenario, drive)
    accumulator.add(time_ns, record, reference, commands)  # for each block
    metrics = accumulator.finish(status, end_ns)

`run_metrics(run)` does this for a run in memory. `table` defines all metrics.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
