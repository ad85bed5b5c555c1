"""Test numbers of campaign files at the ends of their allowed ranges, and extreme floats.

Either a campaign is refused with a remedy, or its values are finite, within the ends of their distribution,
and the same in every block. Other files compare with independent results: `test_distributions.py` and
`test_statistics.py` with SciPy, and `test_sensitivity.py` with closed forms.
"""

import math
import re
from typing import Any, NamedTuple

import numpy as np
import pytest

from cranectl.campaign import Campaign, make_campaign, sample_values
from cranectl.campaign.load import check_values
from cranectl.campaign.settings import CampaignSettings
from cranectl.support.errors import InputError
from tests.campaign.campaigns import MIXED, PAIR, PUSH, table
from tests.ranges import Key, ends, has_found_allowed_and_remedy, put, result_or_refusal, share_of

ROWS = 4  # samples checked at either end of a campaign
# For numbers of distributions, which have no bounds in any schema.
EXTREME = (-1e308, -1.0, -5e-324, 0.0, 5e-324, 1e-12, 1e12, 1e308)
UNCERTAIN: dict[str, dict[str, Any]] = {
    **{name: distribution for name, distribution in MIXED.items() if name != "effects.delay.seconds"},
    "disturbances.0.magnitude": PUSH | {"low": -1.0, "high": 1.0, "mean": 0.1},
    "initial.alpha_offset": PUSH | {"mean": 0.0, "deviation": 0.01},
    "effects.sensing.seed": {"distribution": "integers", "low": 0, "high": 9},
}
RULE = re.compile(
    r"found: .* (must|need|needs|is missing|take|takes no) .*remedy: ", re.DOTALL
)  # errors about two numbers together
SAMPLINGS = ("monte-carlo", "latin-hypercube", "sobol", "saltelli", "grid", "one-at-a-time")


class Case(NamedTuple):
    """A campaign with one changed number."""

    name: str
    key: Key
    value: float
    sampling: str


def base(sampling: str) -> dict[str, Any]:
    changes: dict[str, Any] = {"sampling": sampling, "runs": 64, "seed": 1, "spread": 1.0}
    uncertain = UNCERTAIN
    if sampling in ("grid", "one-at-a-time"):
        del changes["runs"]
    if sampling == "grid":
        density = ("uniform", "log-uniform", "normal")
        uncertain = {
            name: kind | ({"levels": 2} if kind["distribution"] in density else {})
            for name, kind in UNCERTAIN.items()
            if kind["distribution"] in (*density, "choice")
        }
    elif sampling not in ("one-at-a-time", "saltelli"):
        changes["correlation"] = PAIR
    return table(uncertain, **changes)


def cases() -> list[Case]:
    result = []
    for sampling in SAMPLINGS:
        numbers: list[tuple[Key, float]] = [
            (key, value) for key, value in ends(CampaignSettings) if key[0] in base(sampling)
        ]
        for name, kind in base(sampling)["uncertain"].items():
            for key, value in kind.items():
                if key in ("low", "high", "mean", "deviation", "value"):
                    numbers += [(("uncertain", name, key), extreme) for extreme in EXTREME]
                elif key in ("values", "weights"):
                    numbers += [(("uncertain", name, key, 0), extreme) for extreme in EXTREME]
                elif key == "levels":
                    numbers += [(("uncertain", name, key), value) for value in (1, 10_000)]
        for key, value in numbers:
            result.append(Case(f"{sampling} {'.'.join(map(str, key))}={value:g}", key, value, sampling))
    return result


CASES = cases()
ALWAYS_TRIED = ("sobol uncertain.initial.alpha_offset.deviation=1e+308",)  # it once failed


def drawn(case: Case) -> tuple[Campaign, np.ndarray]:
    changed = put(base(case.sampling), case.key, case.value)
    campaign = make_campaign(CampaignSettings.parse(changed, "own.toml"))
    check_values(campaign)
    last = max(campaign.runs - ROWS, 0)
    values = [sample_values(campaign, first, min(first + ROWS, campaign.runs)) for first in (0, last)]
    return campaign, np.concatenate(values)


@pytest.mark.parametrize("case", share_of(CASES, 60, ALWAYS_TRIED), ids=lambda case: case.name)
def test_a_campaign_is_drawn_or_refused(case: Case) -> None:
    result = result_or_refusal(lambda: drawn(case))
    if isinstance(result, InputError):
        assert has_found_allowed_and_remedy(str(result)) or RULE.search(str(result))
        return
    campaign, values = result
    assert np.isfinite(values).all()
    last_row = sample_values(campaign, campaign.runs - 1, campaign.runs)
    assert np.array_equal(last_row[0], values[-1]), "a row is the same in whatever block"
    spread = campaign.settings.spread
    for column, (name, kind) in zip(values.T, campaign.settings.uncertain.items(), strict=True):
        if spread != 1.0:
            continue
        low, high = kind.ends(math.nan if not kind.relative else 1.0)
        nominal = [] if case.sampling not in ("one-at-a-time",) else [column[0]]
        assert all(low <= value <= high or value in nominal for value in column), name
