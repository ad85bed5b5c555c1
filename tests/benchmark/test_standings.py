"""Numbers and names on docs/reference/standings.md, computed again from the rows of the judged table.

Nothing here uses the code that writes the page: rows come from pyarrow, and shares are counted one by one.
"""

import json
import re
from collections import defaultdict
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from pyarrow import parquet
from scipy.stats import binomtest

from cranectl.campaign.definition import sampled_scenario
from cranectl.campaign.sampling import sample_values
from cranectl.support.documents import TOML
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.declared import Variable, variables_of
from cranectl.tools.benchmark.report.page import judged_divisions
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import BenchmarkTable
from cranectl.tools.benchmark.trials import Trial, campaign_of
from docs.standings import of_bounds
from tests.conftest import ROOT

FOLDER = ROOT / "validation" / "benchmark"
PAGE = (ROOT / "docs" / "reference" / "standings.md").read_text(encoding="utf-8")
FLAT_PAGE = " ".join(PAGE.split())
RANKED = ("point-to-point", "hoist-and-go", "pulse", "standing-push", "way-points", "harbour")
SETS = ("nominal", "lab-rig", "hard")
OURS = "lqr-offset-free"


class Cell(NamedTuple):
    """Runs of one controller in one scenario on one set."""

    failed: list[bool]
    unsettled: list[float]  # share of the rest phase
    effort: list[float]


def rows() -> tuple[list[dict[str, Any]], dict[str, Any]]:
    table = parquet.read_table(FOLDER / "literature.parquet")
    return table.to_pylist(), json.loads(table.schema.metadata[b"benchmark"])


ROWS, ABOUT = rows()


def cells() -> dict[tuple[str, str, str, str], Cell]:
    """Return the runs on mujoco by division, set, scenario and controller."""
    grouped = defaultdict(list)
    for row in ROWS:
        if row["plant"] == "mujoco":
            grouped[row["division"], row["crane_set"], row["scenario"], row["law"]].append(row)
    result = {}
    for key, group in grouped.items():
        rests = [row["rest_s"] for row in group if row["rest_s"] == row["rest_s"]]
        horizon = ABOUT["durations"][key[2]] - (min(rests) if rests else 0.0)
        times = [
            row["settling_time_s"] if row["settling_time_s"] == row["settling_time_s"] else horizon
            for row in group
        ]
        result[key] = Cell(
            [row["failed"] for row in group],
            [
                1.0 if row["failed"] else min(time, horizon) / horizon
                for row, time in zip(group, times, strict=True)
            ],
            [np.inf if row["failed"] else row["effort_m_s2"] for row in group],
        )
    return result


CELLS = cells()
CONTROLLERS = sorted({key[3] for key in CELLS})


def standing(division: str, crane_set: str, controller: str) -> tuple[float, float, float]:
    """Return share of failures, of unsettled time, and effort over all ranked scenarios."""
    of = [CELLS[division, crane_set, scenario, controller] for scenario in RANKED]
    failed = [value for cell in of for value in cell.failed]
    effort = [value for cell in of for value in cell.effort]
    return (
        sum(failed) / len(failed),
        sum(sum(c.unsettled) / len(c.unsettled) for c in of) / len(of),
        float(np.median(effort)),
    )


def shown(numbers: tuple[float, float, float]) -> str:
    effort = f"{numbers[2]:.2f}" if np.isfinite(numbers[2]) else "fails"
    return f"{100.0 * numbers[0]:.1f} / {100.0 * numbers[1]:.1f} / {effort}"


def table_below(heading: str) -> Iterator[list[str]]:
    """Yield the rows of the first table below a heading or text, as texts without marks."""
    lines = iter(PAGE.partition(heading)[2].splitlines())
    for line in lines:
        if line.startswith("|---"):
            break
    for line in lines:
        if not line.startswith("|"):
            return
        yield [cell.strip(" *★").replace(" (ours)", "") for cell in line.strip("|").split("|")]


@pytest.mark.parametrize(
    ("heading", "division", "sets"),
    [("## Tuned\n", "tuned", SETS), ("## As published", "published", SETS[:2])],
)
def test_rankings_and_their_stars(heading: str, division: str, sets: tuple[str, ...]) -> None:
    found = {name: (place, numbers) for name, _, place, *numbers in table_below(heading)}
    assert sorted(found) == CONTROLLERS
    points = {(s, name): standing(division, s, name) for s in sets for name in CONTROLLERS}
    for name, (place, numbers) in found.items():
        assert numbers == [shown(points[s, name]) for s in sets], name
        fronts = [
            s
            for s in sets
            if not any(
                all(a <= b for a, b in zip(points[s, other], points[s, name], strict=True))
                and points[s, other] != points[s, name]
                for other in CONTROLLERS
            )
        ]
        expected = "all sets" if fronts == list(sets) else ", ".join(fronts)
        assert place.removesuffix(", by effort alone") == expected, name
    order = [points[sets[-1], name][:2] for name in found]
    if division == "tuned":
        assert order == sorted(order)


def test_numbers_before_and_after_tuning() -> None:
    found = list(table_below("## Before and after tuning"))
    assert sorted(name for name, *_ in found) == CONTROLLERS
    for name, _, *numbers in found:
        before, after = (shown(standing(d, "lab-rig", name)).split(" / ") for d in ("published", "tuned"))
        assert numbers == [n for pair in zip(before, after, strict=True) for n in pair], name


def test_who_settles_sooner_than_ours_in_a_scenario() -> None:
    """All of them are named, in order, and nobody else."""
    expected = []
    for scenario in RANKED:
        for crane_set in SETS:
            of = {name: CELLS["tuned", crane_set, scenario, name] for name in CONTROLLERS}
            shares = {name: (np.mean(c.failed), np.mean(c.unsettled)) for name, c in of.items()}
            own = shares[OURS]
            better = sorted(
                (share, name) for name, (lost, share) in shares.items() if lost <= own[0] and share < own[1]
            )
            if better:
                names = ", ".join(f"`{name}` {100.0 * share:.1f}" for share, name in better)
                expected.append([f"`{scenario}`", f"`{crane_set}`", names, f"{100.0 * own[1]:.1f}"])
    assert list(table_below("settle sooner:")) == expected
    assert any("`model-reference` 45.9" in row[2] for row in expected)


def test_who_settles_sooner_than_ours_in_all() -> None:
    for name in CONTROLLERS:
        sooner = [
            s
            for s in SETS
            if standing("tuned", s, name)[0] <= standing("tuned", s, OURS)[0]
            and standing("tuned", s, name)[1] < standing("tuned", s, OURS)[1]
        ]
        match = re.search(rf"- `{re.escape(name)}` settles sooner on (.*?)\. Cranes that (.*?)\. ", FLAT_PAGE)
        assert (match is not None) == bool(sooner), name
        if match:
            assert re.findall(r"`([a-z-]+)` \(unsettled", match[1]) == sooner
            lost = {s: sum(CELLS["tuned", "hard", s, name].failed) for s in RANKED}
            said = re.findall(r"(\d+) of 32 in `([a-z-]+)`", match[2])
            assert said == [(str(number), s) for s, number in lost.items() if number], name
    assert "`lqg` settles sooner" in FLAT_PAGE


def test_why_controllers_fail_names_all_that_do() -> None:
    found = {where.strip("`"): text for where, text, _ in table_below("**Why controllers fail**")}
    scenarios = {key[2] for key in CELLS}
    for scenario in scenarios:
        of = {key[3]: c.failed for key, c in CELLS.items() if key[:3] == ("tuned", "lab-rig", scenario)}
        expected = {name: f"{100.0 * np.mean(lost):.0f}" for name, lost in of.items() if any(lost)}
        named: dict[str, str] = {}
        text = found.get(scenario, "")
        if group := re.search(r"(\d+) of (\d+): (\d+)", text):
            of_share = [name for name, share in expected.items() if share == group[3]]
            assert (len(of_share), len(of)) == (int(group[1]), int(group[2]))
            named |= dict.fromkeys(of_share, group[3])
            text = text.replace(group[0], "")
        for names, share in re.findall(r"((?:`[^`]+`(?:, | and )?)+) (\d+)", text):
            named |= dict.fromkeys(re.findall(r"`([^`]+)`", names), share)
        assert named == expected, scenario


def test_sentences_on_scenarios_plants_and_spreads() -> None:
    tuned = {key[1:]: cell for key, cell in CELLS.items() if key[0] == "tuned"}
    number = len(CONTROLLERS)
    lost = [name for name in CONTROLLERS if all(tuned["lab-rig", "standing-push", name].failed)]
    others = [s for s in RANKED if s != "standing-push"]
    safe = {
        s: {c for c in CONTROLLERS if not any(any(tuned[s, other, c].failed) for other in others)}
        for s in SETS
    }
    assert f"{len(lost)} of {number} tuned controllers fail on every crane of `lab-rig`" in FLAT_PAGE
    sentence = re.search(r"(\d+) fail nowhere there, and (\d+) fail nowhere on `hard`: (.*?)\.", FLAT_PAGE)
    assert sentence is not None
    assert (int(sentence[1]), int(sentence[2])) == (len(safe["lab-rig"]), len(safe["hard"]))
    assert set(re.findall(r"`([^`]+)`", sentence[3])) == safe["hard"]
    never = {c for c in CONTROLLERS if not any(standing("tuned", s, c)[0] for s in SETS)}
    assert OURS in never
    assert f"Others that lose none: {' and '.join(f'`{c}`' for c in sorted(never - {OURS}))}." in FLAT_PAGE
    runs = sum(len(tuned[s, scenario, OURS].failed) for s in SETS for scenario in RANKED)
    assert f"loses no cranes of the {runs} ranked ones" in FLAT_PAGE

    by_crane: dict[tuple[Any, ...], dict[str, dict[str, Any]]] = defaultdict(dict)
    for row in ROWS:
        if row["division"] == "tuned":
            key = tuple(row[name] for name in ("crane_set", "scenario", "law", "sample"))
            by_crane[key][row["plant"]] = row
    both = {key: pair for key, pair in by_crane.items() if len(pair) == 2}
    equal = sum(pair["mujoco"]["failed"] == pair["elastic"]["failed"] for pair in both.values())
    assert f"failure of {equal} of the {len(both)} tuned runs that both have" in FLAT_PAGE
    gaps = defaultdict(list)
    for key, pair in both.items():
        gaps[key[2]].append(abs(pair["mujoco"]["rms_error_m"] - pair["elastic"]["rms_error_m"]))
    middle = max(1e3 * np.nanmedian(of) for of in gaps.values())
    assert f"at most {middle:.2g} mm in the median of a controller" in FLAT_PAGE
    largest = max((max(of), name) for name, of in gaps.items())
    assert f"The largest difference is {1e3 * largest[0]:.0f} mm, with `{largest[1]}`" in FLAT_PAGE

    wide = {c: sum(tuned["spread-4", "hoist-and-go", c].failed) for c in CONTROLLERS}
    assert f"the best lose {min(wide.values())} of 12 cranes there" in FLAT_PAGE
    spreads = ("spread-1", "spread-1.5", "spread-2", "spread-2.5")
    some = [c for c in CONTROLLERS if not any(any(tuned[s, "hoist-and-go", c].failed) for s in spreads)]
    assert f"Up to 2.5 times the spread, {len(some)} of {number} lose none." in FLAT_PAGE
    assert all(any(tuned["spread-3", "hoist-and-go", c].failed) for c in CONTROLLERS)


def test_sentences_on_tuning() -> None:
    chosen = [facts["chosen"] for facts in ABOUT["tuned"].values()]
    half, full = chosen.count("half"), chosen.count("full")
    assert half + full == len(CONTROLLERS), "no published numbers were chosen"
    assert f"It chose those of half the budget for {half}, and those of all for {full}." in FLAT_PAGE
    before, after = (100.0 * standing(d, "lab-rig", OURS)[1] for d in ("published", "tuned"))
    assert f"unsettled for {before:.1f} % of the time before tuning and for {after:.1f} % after" in FLAT_PAGE
    fewer = more = 0
    for name in CONTROLLERS:
        lost = [
            [value for s in RANKED for value in CELLS[d, "lab-rig", s, name].failed]
            for d in ("published", "tuned")
        ]
        old, new = (binomtest(sum(of), len(of)).proportion_ci(0.95, method="wilson") for of in lost)
        fewer += new.high < old.low
        more += new.low > old.high
    assert more == 0
    assert f"no controllers fail more than chance explains, and {fewer} fail less" in FLAT_PAGE
    mended = [
        f"`{name}` {100.0 * np.mean(CELLS['published', 'lab-rig', s, name].failed):.0f} % in `{s}`"
        for s in RANKED
        for name in CONTROLLERS
        if np.mean(CELLS["published", "lab-rig", s, name].failed) > 0.5
        and standing("tuned", "lab-rig", name)[0] == 0.0
    ]
    assert f"as published: {' and '.join(mended)}." in FLAT_PAGE


def test_answers_about_two_controllers() -> None:
    """Numbers of sentences that people wrote, from tuned numbers, drawn cranes and final errors."""
    benchmark = Benchmark.read("literature")
    name = "hierarchical-sliding-mode"
    numbers = TOML.read(FOLDER / "tuned" / f"{name}.toml")["parameters"]
    campaign = campaign_of(benchmark, Trial("published", "mujoco", "lab-rig", "standing-push", "lqr"))
    needed = []
    for values in sample_values(campaign, 0, campaign.runs):
        drawn = sampled_scenario(campaign, values, "a crane")
        force = drawn.disturbances[0].force
        assert force is not None
        leans = [abs(part) / (drawn.rig.load_mass * drawn.rig.gravity) for part in force[:2]]
        needed += [numbers[f"controller.{name}.share"] * lean for lean in leans]
    assert f"that is {min(needed):.3f} to {max(needed):.3f} g." in FLAT_PAGE
    assert f"Tuning found r = {numbers[f'controller.{name}.reach']:.3f} g, the lower bound" in FLAT_PAGE
    assert all(CELLS["tuned", "lab-rig", "standing-push", name].failed)
    ends = [
        row["final_error_m"]
        for row in ROWS
        if (row["division"], row["plant"], row["crane_set"], row["scenario"], row["law"])
        == ("published", "mujoco", "lab-rig", "standing-push", name)
    ]
    assert f"it ends {min(ends):.2f} to {max(ends):.2f} m from its goal" in FLAT_PAGE
    numbers = TOML.read(FOLDER / "tuned" / "lqg.toml")["parameters"]
    assert f"`sway_filter` is {numbers['controller.lqg.sway_filter']:.1f} instead" in FLAT_PAGE
    assert not any(any(CELLS["tuned", "lab-rig", s, "lqg"].failed) for s in RANKED)
    lost = {s: sum(CELLS["tuned", "hard", s, "lqg"].failed) for s in RANKED}
    assert lost["harbour"] > sum(lost.values()) / 2


def test_numbers_at_a_bound_of_their_search() -> None:
    benchmark = Benchmark.read("literature")
    divisions = judged_divisions(benchmark, BenchmarkTable.read(FOLDER / "literature.parquet"))
    searched = {name: variables_of(name) for name in measured_controllers(benchmark)}
    declared = re.findall(
        r'\{"(\w+)", .*, (\S+), \S+, \S+, \{(\S+), (\S+)\}, \S+\}',
        (FOLDER / "nmpc" / "nmpc.c").read_text(encoding="utf-8"),
    )
    searched["nmpc"] = tuple(
        Variable(f"controller.nmpc.{key}", *map(float, numbers)) for key, *numbers in declared
    )
    assert len(searched["nmpc"]) == 4
    sentence, table = of_bounds(divisions[0], searched)
    assert sentence in FLAT_PAGE
    assert table in PAGE
