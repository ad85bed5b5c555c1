"""Write and read all runs of a benchmark as one Parquet file, from which the page is made.

A row is a run, with its trial, its sample and the compared metrics. The metadata of the file contain facts
about controllers and scenarios as JSON.
"""

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.campaign import EFFORT, Columns, effort, failed
from cranectl.metrics import Metric
from cranectl.support import Array, File, InputError, Mask
from cranectl.tools.benchmark.trials import Trial

VARIATION = "variation_m_s2"  # sum of the command variations of all drives
METRICS = (
    "rms_error_m",
    "final_error_m",
    "settling_time_s",
    "overshoot_m",
    "residual_sway_about_lean_rad",
    "max_sway_rad",
    "saturated_s",
    "rest_s",
)
TRIAL_COLUMNS = ("division", "plant", "crane_set", "scenario", "law")  # the fields of a trial, as filed
ABOUT = b"benchmark"  # key of the metadata
ABOUT_KEYS = ("rules", "seed", "made_by", "durations", "laws", "tuned")  # keys of its JSON


@dataclass(frozen=True)
class Runs:
    """The n runs of a trial, in the order of samples."""

    failed: Mask  # (n,)
    status: tuple[str, ...]
    metrics: Mapping[str, Array]  # (n,) each; NaN if a run does not have the metric

    @property
    def settling(self) -> Array:
        """Time from the end of the path until the load has settled [s], (n,); NaN if it does not settle."""
        return self.metrics["settling_time_s"]

    @property
    def task(self) -> Array:
        """Time from the start until the load has settled [s], (n,); NaN if a run fails or does not settle."""
        return np.where(self.failed, np.nan, self.metrics["rest_s"] + self.settling)

    def first(self, cranes: int) -> "Runs":
        """Return the runs of the first `cranes` samples."""
        metrics = {name: values[:cranes] for name, values in self.metrics.items()}
        return Runs(self.failed[:cranes], self.status[:cranes], metrics)

    @staticmethod
    def in_common(runs: "Sequence[Runs]") -> "list[Runs]":
        """Return `runs` with only the cranes that all of them have."""
        cranes = min(run.failed.size for run in runs)
        return [run.first(cranes) for run in runs]

    @staticmethod
    def of(column: Columns, limits: Mapping[str, float]) -> "Runs":
        """Return the runs of one trial from the columns of its result and the `limits` of its campaign."""
        metrics = {name: np.asarray(column(name), dtype=np.float64) for name in METRICS}
        metrics[EFFORT] = effort(column)
        metrics[VARIATION] = np.sum(
            [column(name) for name in Metric.named("command_variation_m_s2").columns], axis=0
        )
        return Runs(failed(column, limits), tuple(np.asarray(column("status")).tolist()), metrics)


@dataclass(frozen=True)
class BenchmarkTable:
    """The runs of all trials, and facts `about` them.

    - `rules` and `seed`: digest of the benchmark's rules, and seed of its cranes.
    - `made_by`: versions and fingerprints of each software that made runs.
    - `durations`: duration of each scenario [s].
    - `laws`: by controller, the result of `information`.
    - `tuned`: by controller, the result of `tuned_facts`.
    """

    about: Mapping[str, Any]
    trials: Mapping[Trial, Runs]

    @staticmethod
    def write(path: Path, table: "BenchmarkTable") -> None:
        """Write the table in one atomic step, with metrics to four digits."""
        import pyarrow
        from pyarrow import parquet

        columns: dict[str, list[Any]] = {name: [] for name in (*TRIAL_COLUMNS, "sample", "failed", "status")}
        numbers: dict[str, list[Array]] = {name: [] for name in (*METRICS, EFFORT, VARIATION)}
        for trial, runs in table.trials.items():
            n = len(runs.status)
            for name, value in zip(TRIAL_COLUMNS, trial, strict=True):
                columns[name] += [value] * n
            columns["sample"] += range(n)
            columns["failed"] += runs.failed.tolist()
            columns["status"] += runs.status
            for name, values in runs.metrics.items():
                numbers[name].append(values)
        arrays = {name: round_metrics(np.concatenate(values)) for name, values in numbers.items()}
        arrow = pyarrow.table({**columns, **arrays})
        arrow = arrow.replace_schema_metadata({ABOUT: json.dumps(table.about, sort_keys=True)})
        with File(path).replacing() as unfinished, unfinished.open("wb") as stream:
            parquet.write_table(arrow, stream, compression="zstd", compression_level=19)

    @staticmethod
    def read(path: Path) -> "BenchmarkTable":
        """Read a file of `write`; raise InputError for any other file."""
        import pyarrow
        from pyarrow import parquet

        try:
            with File(path).open() as stream:
                arrow = parquet.read_table(stream)
            metadata = json.loads(arrow.schema.metadata[ABOUT])
            about = {name: metadata[name] for name in ABOUT_KEYS}
            keys = list(zip(*(arrow[name].to_pylist() for name in TRIAL_COLUMNS), strict=True))
            columns = {
                name: arrow[name].to_numpy() for name in (*METRICS, EFFORT, VARIATION, "failed", "status")
            }
        except (OSError, pyarrow.ArrowException, KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{path} holds no benchmark: {error}",
                allowed="a file that 'cranectl benchmark report --table' has written",
                remedy="check the path",
            ) from None
        ends = [k for k in range(1, len(keys)) if keys[k] != keys[k - 1]]
        trials = {}
        for rows in np.split(np.arange(len(keys)), ends):
            metrics = {name: columns[name][rows].astype(np.float64) for name in (*METRICS, EFFORT, VARIATION)}
            failed_runs = columns["failed"][rows].astype(bool)
            trials[Trial(*keys[rows[0]])] = Runs(failed_runs, tuple(columns["status"][rows]), metrics)
        return BenchmarkTable(about, trials)

    @staticmethod
    def join(tables: "Iterable[BenchmarkTable]") -> "BenchmarkTable":
        """Join several tables; if two contain the same trial or fact, the first of them is used.

        Raises InputError as `check_comparable` does.
        """
        first, *others = tables
        about, trials = dict(first.about), dict(first.trials)
        for table in others:
            table.check_comparable(about)
            trials = {**table.trials, **trials}
            about |= {name: {**table.about[name], **about[name]} for name in ("durations", "laws", "tuned")}
            new_software = [item for item in table.about["made_by"] if item not in about["made_by"]]
            about["made_by"] = [*about["made_by"], *new_software]
        return BenchmarkTable(about, trials)

    def check_comparable(self, about: Mapping[str, Any]) -> None:
        """Raise InputError unless rules, seed, controller files and tuned numbers equal those of `about`."""
        compared = [(name, self.about[name], about[name]) for name in ("rules", "seed")]
        for part, fact in (("laws", "file"), ("tuned", "numbers")):
            facts, expected_facts = self.about[part], about.get(part, {})
            compared += [
                (f"{fact} of {controller}", facts[controller][fact], expected_facts[controller][fact])
                for controller in facts
                if controller in expected_facts
            ]
        for name, actual, expected in compared:
            if actual != expected:
                raise InputError(
                    f"results whose {name} differ: {actual} and {expected}",
                    allowed="results of one benchmark with the same rules, cranes and controllers",
                    remedy="run the controllers again with this version of the benchmark",
                )

    def select(self, controllers: Collection[str]) -> "BenchmarkTable":
        """Return the table with the trials of `controllers` only; raise InputError if one has no trials."""
        InputError.check_known("controller of the table", controllers, self.about["laws"])
        about = {
            part: {name: facts for name, facts in self.about[part].items() if name in controllers}
            for part in ("laws", "tuned")
        }
        return BenchmarkTable(
            {**self.about, **about}, {p: r for p, r in self.trials.items() if p.controller in controllers}
        )


def round_metrics(values: Array) -> Any:
    """Return values round_metrics to four digits, as float32, which compresses well."""
    scale = 10.0 ** (3 - np.floor(np.log10(np.where(np.abs(values) > 0.0, np.abs(values), 1.0))))
    return (np.round(values * scale) / scale).astype(np.float32)
