"""How metrics and parameters of a campaign are called on its page."""

import shlex
from pathlib import Path

from cranectl.campaign.definition import Campaign
from cranectl.campaign.groups import EFFORT
from cranectl.campaign.table import describe
from cranectl.metrics import all_metrics

LEVELS = (0.05, 0.5, 0.95)  # quantiles in tables
METRIC_LABELS = {m.name: f"{m.compared} [{m.unit}]" for m in all_metrics() if m.compared}
METRIC_LABELS[EFFORT] = "effort [m/s²]"


def metric_name(metric: str) -> str:
    """Without its unit."""
    return METRIC_LABELS[metric].partition(" [")[0]


def parameter_label(campaign: Campaign, name: str) -> str:
    """Name and unit; without `effects.`, which says nothing here."""
    unit = describe(campaign, name).unit
    short = name.removeprefix("effects.")
    return f"{short} [{unit}]" if unit else short


def number(value: float | None, digits: int = 3) -> str:
    """For a table; a dash where there is none."""
    return "–" if value is None or value != value else f"{value:.{digits}g}"


def percent(share: float | None) -> str:
    """One digit after the point."""
    return "–" if share is None or share != share else f"{100.0 * share:.1f}"


def probability(p: float) -> str:
    """Of a test."""
    return "–" if p != p else "< 0.001" if p < 1e-3 else f"{p:.3f}"


def replay_command(directory: Path, sample: int, controller: str, plant: str = "") -> str:
    """What runs a sample again; on all plants where none is named."""
    on = f" --plant {plant}" if plant else ""
    return (
        f"cranectl campaign replay {shlex.quote(str(directory))} --run {sample} --controller {controller}{on}"
    )
