"""The runs of a result by plant and controller, arranged by sample: groups compare sample by sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.results import Results
from cranectl.campaign.rows import METRIC_COLUMNS
from cranectl.campaign.summary import failed
from cranectl.status import RunStatus

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MAIN_METRICS = (
    "max_error_m",
    "rms_error_m",
    "final_error_m",
    "settling_time_s",
    "residual_sway_rad",
    "min_rope_tension_n",
)
EFFORTS = tuple(name for name in METRIC_COLUMNS if name.startswith("rms_acceleration_m_s2"))
EFFORT = "effort_m_s2"  # RMS of the commanded accelerations of all drives together


@dataclass(frozen=True)
class Group:
    """The runs with one controller on one plant; arrays (samples,), by index of the sample."""

    plant: str
    controller: str
    there: Mask  # the run is in the result
    completed: Mask
    failed: Mask  # did not complete, or broke a limit
    metrics: dict[str, Array]  # MAIN_METRICS and EFFORT; NaN unless completed

    @property
    def name(self) -> str:
        """Both names, for people."""
        return f"{self.controller} on {self.plant}"


def groups_of(results: Results) -> tuple[Group, ...]:
    """A group for each plant and controller, in the order of the campaign."""
    settings = results.campaign.settings
    columns = {name: results.column(name) for name in ("sample", "plant", "controller", "status")}
    completed = columns["status"] == RunStatus.COMPLETED.label
    bad = failed(results)
    metrics = {name: results.column(name).astype(np.float64) for name in MAIN_METRICS}
    metrics[EFFORT] = np.linalg.norm([results.column(name).astype(np.float64) for name in EFFORTS], axis=0)
    found = []
    for plant in settings.plants:
        for controller in settings.controllers:
            rows = np.flatnonzero((columns["plant"] == plant) & (columns["controller"] == controller))
            samples = columns["sample"][rows]
            there, done, broken = (np.zeros(results.campaign.runs, dtype=np.bool_) for _ in range(3))
            there[samples], done[samples], broken[samples] = True, completed[rows], bad[rows]
            by_sample = {
                name: _placed(values[rows], samples, done, results.campaign.runs)
                for name, values in metrics.items()
            }
            found.append(Group(plant, controller, there, done, broken, by_sample))
    return tuple(found)


def parameter_values(results: Results) -> Array:
    """Values of the uncertain parameters as recorded, (samples, d); NaN for samples without any run."""
    campaign = results.campaign
    values = np.full((campaign.runs, len(campaign.names)), np.nan)
    samples = results.column("sample")
    for column, name in enumerate(campaign.names):
        values[samples, column] = results.column(name)
    return values


def compared_parameters(results: Results) -> list[int]:
    """Columns of the parameters that metrics can depend on in order: they vary and are no seeds."""
    campaign = results.campaign
    return [k for k in campaign.varied if not campaign.names[k].endswith(".seed")]


def _placed(values: Array, samples: NDArray[np.int64], keep: Mask, runs: int) -> Array:
    placed = np.full(runs, np.nan)
    placed[samples] = values
    placed[~keep] = np.nan
    return placed
