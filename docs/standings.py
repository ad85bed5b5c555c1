"""What docs/reference/standings.md says of the judged table; all numbers and names come from the runs."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cranectl.report.table import Cell
from cranectl.tools.benchmark import scores
from cranectl.tools.benchmark.declared import Variable
from cranectl.tools.benchmark.ranking import Judged, Standing, rest_time
from cranectl.tools.benchmark.report.opening import tuning_changes
from cranectl.tools.benchmark.report.sets import OUR_CONTROLLER
from cranectl.tools.benchmark.table import Runs
from cranectl.tools.benchmark.trials import radius_sets

Text = Iterator[str]  # paragraphs, lists and tables in Markdown

DISTURBED = "standing-push"  # the scenario with a constant disturbance
EXPLAINED_SET = "lab-rig"
NEAR_BOUND = 0.02  # of the range of a search, on its logarithmic scale
MANY_FAILURES = 0.5  # share of the cranes of a scenario, of which a sentence tells if tuning avoids them
REASONS = {
    "point-to-point": "the load still swings",
    "hoist-and-go": "the load still swings after it was hoisted",
    "pulse": "the load still swings; `pid` measures no angle",
    "standing-push": "nothing in them observes the disturbance or integrates the load's error",
    "way-points": "tilted rails act like a disturbance",
    "operator": "[friction](../explanation/controllers.md#flat-velocity) holds drives whose set-points "
    "follow them",
    "harbour": "they demand more than the bridge can do",
}


def statements(divisions: Sequence[Judged]) -> Text:
    """Yield the parts of the page that follow its rankings."""
    tuned, published = (next(j for j in divisions if j.division == d) for d in ("tuned", "published"))
    yield "## What the runs show"
    yield from of_our_controller(tuned, published)
    yield from of_one_scenario(tuned)
    yield from of_tuning(tuned, published)
    yield from of_plants(tuned)
    yield from of_wide_spreads(tuned)
    yield from of_failures(tuned)


def of_our_controller(tuned: Judged, published: Judged) -> Text:
    """Tell on which sets ours is undominated, who loses no crane either, and who settles sooner."""
    fronts = [(judged, name) for judged in (tuned, published) for name in judged.ranked_sets]
    number = sum(OUR_CONTROLLER in judged.front(name) for judged, name in fronts)
    yield (
        f"**`{OUR_CONTROLLER}` is undominated on {number} of {len(fronts)} judged sets**, in both divisions. "
        "It is [ours, and has advantages](../how-to/benchmark.md#rules)."
    )
    rows = {name: [standings_of(tuned, s)[name] for s in tuned.ranked_sets] for name in tuned.best_first}
    own, total = rows.pop(OUR_CONTROLLER), sum(s.runs for s in rows[tuned.best_first[-1]])
    safe = [name for name, found in rows.items() if not sum(s.failures for s in found)]
    sentences = [
        f"Tuned, it loses {counted(sum(s.failures for s in own), 'crane')} of the {total} ranked ones. "
        f"Others that lose none: {named(safe) or 'none'}."
    ]
    for name in safe:
        pairs = list(zip(rows[name], own, strict=True))
        efforts = {np.sign(a.effort - b.effort) for a, b in pairs}
        settles = {np.sign(a.unsettled - b.unsettled) for a, b in pairs}
        sentences.append(
            f"`{name}` needs {on_all(efforts, 'less', 'more')} effort and settles "
            f"{on_all(settles, 'sooner', 'later')}."
        )
    yield bullet(" ".join(sentences))
    sooner = {
        name: [(s, a, b) for s, a, b in zip(tuned.ranked_sets, found, own, strict=True) if is_sooner(a, b)]
        for name, found in rows.items()
    }
    for name, found in sooner.items():
        if found:
            where = Cell.listed([
                f"`{s}` (unsettled {percent(a.unsettled)}, ours {percent(b.unsettled)}; effort "
                f"{a.effort:.2f}, ours {b.effort:.2f} m/s²)"
                for s, a, b in found
            ])  # fmt: skip
            yield bullet(f"`{name}` settles sooner on {where}. {lost_cranes(tuned, name)}")
    yield "Of the scenarios alone, some controllers lose no crane more than ours and settle sooner:"
    table = ["| scenario | set | sooner than ours, unsettled % | ours |", "|---|---|---|---|"]
    for scenario in tuned.shared_scenarios(tuned.ranked_sets[0]):
        for crane_set in tuned.ranked_sets:
            failed, unsettled = unsettled_in(tuned, crane_set, scenario, OUR_CONTROLLER)
            others = {name: unsettled_in(tuned, crane_set, scenario, name) for name in rows}
            better = {n: u for n, (f, u) in others.items() if f <= failed and u < unsettled}
            if better:
                names = ", ".join(f"`{n}` {u:.1%}" for n, u in sorted(better.items(), key=lambda i: i[1]))
                names = names.replace("%", "")
                table.append(f"| `{scenario}` | `{crane_set}` | {names} | {100.0 * unsettled:.1f} |")
    yield "\n".join(table)


def of_one_scenario(tuned: Judged) -> Text:
    """Tell how many controllers fail on every crane of one scenario, and who fails nowhere in the others."""
    lost = [name for name, share in failures(tuned, EXPLAINED_SET, DISTURBED).items() if share == 1.0]
    others = [s for s in tuned.shared_scenarios(EXPLAINED_SET) if s != DISTURBED]
    text = (
        f"**One scenario decides.** Under a constant disturbance, {len(lost)} of {len(tuned.controllers)} "
        f"tuned controllers fail on every crane of `{EXPLAINED_SET}`. In the other {len(others)} ranked "
        "scenarios "
    )
    safe = {
        name: [c for c in tuned.best_first if not any(failures(tuned, name, s).get(c, 1.0) for s in others)]
        for name in (EXPLAINED_SET, "hard")
    }
    yield (
        f"{text}{len(safe[EXPLAINED_SET])} fail nowhere there, and {len(safe['hard'])} fail nowhere on "
        f"`hard`: {named(safe['hard'])}."
    )


def of_tuning(tuned: Judged, published: Judged) -> Text:
    """Tell whom tuning helps, and which numbers validation chose."""
    changes = tuning_changes([tuned, published])[EXPLAINED_SET]
    marks = [change.mark for change in changes]
    scenarios, own_set = tuned.shared_scenarios(EXPLAINED_SET), standings_of(tuned, EXPLAINED_SET)
    mended = [
        f"`{name}` {percent(before, 0)} in `{scenario}`"
        for scenario in scenarios
        for name, before in failures(published, EXPLAINED_SET, scenario).items()
        if before > MANY_FAILURES and not own_set[name].failures
    ]
    chosen = [facts["chosen"] for facts in tuned.table.about["tuned"].values()]
    own = next(change for change in changes if change.after.controller == OUR_CONTROLLER)
    yield (
        f"**What tuning does.** On `{EXPLAINED_SET}` it makes {counted(marks.count('bad'), 'controller')} "
        f"fail more than chance explains, and {marks.count('good')} fail less. Among those that lose no "
        f"crane there once they are tuned, some lose most of a scenario as published: {Cell.listed(mended)}. "
        f"Validation chose published numbers for {counted(chosen.count('untuned'), 'controller')}. It chose "
        f"those of half the budget for {chosen.count('half')}, and those of all for {chosen.count('full')}. "
        f"Ours is unsettled for {percent(own.before.unsettled)} of the time before tuning and for "
        f"{percent(own.after.unsettled)} after it, since the cost counts errors too."
    )


def of_plants(tuned: Judged) -> Text:
    """Tell how often both plants agree on failures, and how much errors differ."""
    benchmark, pairs = tuned.benchmark, dict[tuple[str, str, str], tuple[Runs, Runs]]()
    for trial, runs in tuned.table.trials.items():
        if trial.division == tuned.division and trial.plant == benchmark.second_plant:
            first = tuned.runs(*trial[2:])
            if first is not None:
                pairs[trial[2:]] = first.first(len(runs.status)), runs
    total = sum(len(b.status) for _, b in pairs.values())
    equal = sum(int((a.failed == b.failed).sum()) for a, b in pairs.values())
    gaps = {
        where: np.abs(a.metrics["rms_error_m"] - b.metrics["rms_error_m"]) for where, (a, b) in pairs.items()
    }
    names = list(dict.fromkeys(where[2] for where in gaps))
    medians = [
        float(np.nanmedian(np.concatenate([gap for where, gap in gaps.items() if where[2] == name])))
        for name in names
    ]
    largest = sorted(gaps, key=lambda where: -np.nanmax(gaps[where], initial=0.0))[:2]
    (set_1, scenario_1, name_1), (set_2, scenario_2, name_2) = largest
    one, two = (1e3 * float(np.nanmax(gaps[where])) for where in largest)
    yield (
        f"**Plants agree on controllers.** `{benchmark.plant}` and `{benchmark.second_plant}` agree on the "
        f"failure of {equal} of the {total} tuned runs that both have. RMS errors of the same crane differ "
        f"by at most {1e3 * max(medians):.2g} mm in the median of a controller. The largest difference is "
        f"{one:.0f} mm, with `{name_1}` in `{scenario_1}` on `{set_1}`. Next is {two:.0f} mm, with "
        f"`{name_2}` in `{scenario_2}` on `{set_2}`."
    )


def of_wide_spreads(tuned: Judged) -> Text:
    """Tell how many cranes the best controllers lose at the widest spread, and where some lose none."""
    scenario, lost = tuned.benchmark.radius.scenario, dict[float, dict[str, int]]()
    for name, cranes in radius_sets(tuned.benchmark).items():
        runs = {c: tuned.runs(name, scenario, c) for c in tuned.controllers}
        lost[cranes.spread] = {c: int(r.failed.sum()) for c, r in runs.items() if r is not None}
    widest, best = max(lost), min(lost[max(lost)].values())
    safe = {spread: sum(number == 0 for number in of.values()) for spread, of in lost.items()}
    most = max(spread for spread, number in safe.items() if number)
    up_to = [c for c in lost[most] if not any(of[c] for spread, of in lost.items() if spread <= most)]
    draws = tuned.benchmark.radius.draws
    yield (
        f"**No controller is safe at {widest:g} times the spread.** On `{scenario}` the best lose {best} of "
        f"{draws} cranes there. Up to {most:g} times the spread, {len(up_to)} of {len(lost[most])} lose none."
    )


def of_failures(tuned: Judged) -> Text:
    """Tell which controllers fail in each scenario, on how many cranes, and why."""
    cranes = tuned.benchmark.sets[EXPLAINED_SET].draws
    yield f"**Why controllers fail**, tuned, on `{EXPLAINED_SET}`, in % of {cranes} cranes:"
    rows = ["| where | controllers | why |", "|---|---|---|"]
    for scenario in tuned.benchmark.scenarios:
        by_share: dict[str, list[str]] = {}
        found = failures(tuned, EXPLAINED_SET, scenario)
        for name in sorted(found, key=lambda name: (-found[name], name)):
            if found[name] > 0.0:
                by_share.setdefault(f"{100.0 * found[name]:.0f}", []).append(name)
        parts = [
            f"{len(names)} of {len(found)}: {share}" if len(names) > 9 else f"{named(names)} {share}"
            for share, names in by_share.items()
        ]
        if parts:
            rows.append(f"| `{scenario}` | {', '.join(parts)} | {REASONS[scenario]} |")
    yield "\n".join(rows)
    yield (
        "`flat-velocity` fails in most scenarios for the reason given at `operator`. We know of no remaining "
        "failure that a mistake of ours causes, but cannot exclude one."
    )


def of_bounds(tuned: Judged, searched: Mapping[str, Sequence[Variable]]) -> Text:
    """Tell which tuned numbers lie at a bound of their search; `searched` are the variables by controller.

    The controllers must be opened for that, which takes long. So a test compares this part of the page.
    """
    rows = []
    for name, variables in sorted(searched.items()):
        ends: tuple[list[str], list[str]] = [], []
        for variable in variables:
            value = tuned.table.about["tuned"][name]["numbers"][variable.key][1]
            place = np.log(abs(value) / variable.low) / np.log(variable.high / variable.low)
            for end, distance in zip(ends, (place, 1.0 - place), strict=True):
                if distance < NEAR_BOUND:
                    end.append(f"`{variable.key.rpartition('.')[2]}`")
        if any(ends):
            rows.append(f"| `{name}` | {', '.join(ends[0])} | {', '.join(ends[1])} |".replace("|  |", "| |"))
    yield (
        f"{len(rows)} controllers have a number within {percent(NEAR_BOUND, 0)} of a bound, on the "
        "logarithmic scale of the search. Wider bounds may give them more."
    )
    heading = "| controller | numbers at the lower bound | numbers at the upper bound |"
    yield "\n".join([heading, "|---|---|---|", *rows])


def standings_of(judged: Judged, crane_set: str) -> dict[str, Standing]:
    """Return the standings on a set by controller."""
    return {standing.controller: standing for standing in judged.ranking(crane_set)}


def failures(judged: Judged, crane_set: str, scenario: str) -> dict[str, float]:
    """Return the share of failures by controller, of those that have run this scenario on this set."""
    runs = {name: judged.runs(crane_set, scenario, name) for name in judged.best_first}
    return {name: float(found.failed.mean()) for name, found in runs.items() if found is not None}


def unsettled_in(judged: Judged, crane_set: str, scenario: str, controller: str) -> tuple[float, float]:
    """Return the shares of failures and of unsettled time of a controller in one scenario."""
    runs = judged.runs(crane_set, scenario, controller)
    if runs is None:
        return 1.0, 1.0
    horizon = rest_time(runs, float(judged.table.about["durations"][scenario]))
    return float(runs.failed.mean()), scores.unsettled_share(runs.settling, runs.failed, horizon)


def lost_cranes(judged: Judged, controller: str) -> str:
    """Return a sentence on the cranes that a controller loses on the set with the widest spread."""
    crane_set = judged.ranked_sets[-1]
    lost = [
        f"{int(runs.failed.sum())} of {runs.failed.size} in `{scenario}`"
        for scenario in judged.shared_scenarios(crane_set)
        if (runs := judged.runs(crane_set, scenario, controller)) is not None and runs.failed.any()
    ]
    return f"Cranes that it loses on `{crane_set}`: {Cell.listed(lost) or 'none'}."


def is_sooner(standing: Standing, own: Standing) -> bool:
    """Return True if a controller fails no more than ours and settles sooner."""
    return standing.failed <= own.failed and standing.unsettled < own.unsettled


def on_all(signs: set[float], below: str, above: str) -> str:
    """Return a word for differences that have the same sign on all sets, or both words."""
    return {(-1.0,): below, (1.0,): above}.get(tuple(signs), f"here {below}, there {above}")


def named(controllers: Sequence[str]) -> str:
    """Return controllers as code, with `and` before the last."""
    return Cell.listed([f"`{name}`" for name in controllers])


def counted(number: int, noun: str) -> str:
    """Return a number with its noun."""
    return f"{number or 'no'} {noun}{'s' * (number != 1)}"


def percent(share: float, digits: int = 1) -> str:
    """Return a share in percent."""
    return f"{100.0 * share:.{digits}f} %"


def bullet(text: str) -> str:
    """Return an entry of a list."""
    return f"- {text}"
