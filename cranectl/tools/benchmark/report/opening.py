"""What the page of a benchmark begins with: a picture of each set, three sentences, caveats, tuning."""

from collections.abc import Iterator, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from cranectl.campaign import failure_interval
from cranectl.report import Cell, Section, Table
from cranectl.tools.benchmark import scores
from cranectl.tools.benchmark.ranking import Judged, Standing, points_of
from cranectl.tools.benchmark.report.pictures import KEY, set_pictures
from cranectl.tools.benchmark.report.sets import NAMED, OUR_CONTROLLER, TITLES, finite, named, shown_name

MAX_EXAMPLES = 3  # controllers that a sentence names
MAX_EFFORT_RATIO = 2.0  # by tuning, above which a caveat names the controller
EFFORT_UNIT = "RMS u in m/s²."
MADE_BY_US = (
    f"We wrote {OUR_CONTROLLER} ourselves. Its structure, defaults and bounds were chosen by people who knew "
    "the scenarios and runs of an earlier edition. Its numbers were found like all others, and nobody saw "
    "the judged cranes before: a digest of the rules and of all frozen numbers is their seed.",
    "As published it runs with defaults made in this way. Most others run with first guesses.",
    "A constant disturbance leaves an offset with controllers that do not observe it. It is one of the "
    "ranked scenarios, and of those of the tuning. This favours controllers that observe or integrate, such "
    "as ours.",
)
OF_THE_PROCESSOR = (
    "The last digits of the gains of lqr+hinf and lqr+loop-shaping depend on the processor. On ten judged "
    "cranes of each set, kernels of BLAS for other processors changed what is measured by up to 11 % with "
    "lqr+hinf as published, at the harbour, and by less than 2e-7 with both tuned. They changed no failure."
)


class TuningChange(NamedTuple):
    """One controller on one set before and after tuning."""

    before: Standing
    after: Standing

    @property
    def mark(self) -> str:
        """Mark of a cell: bad if more runs fail beyond chance, good if fewer do, else empty."""
        (low, high), (new_low, new_high) = (
            failure_interval(standing.failures, standing.runs) for standing in self
        )
        return "bad" if new_low > high else "good" if new_high < low else ""

    @property
    def text(self) -> str:
        """The controller with its failures before and after."""
        return f"{self.after.controller} {100.0 * self.before.failed:.1f} → {_percent(self.after.failed)}"


def opening_sections(divisions: Sequence[Judged]) -> Iterator[Section]:
    """Yield pictures, sentences and caveats, and the numbers before and after tuning."""
    leading = leading_division(divisions)
    if leading is None:
        return
    title = f"{TITLES[leading.division]}: failures and settling"
    yield Section("result", title, (KEY,), figures=tuple(set_pictures(leading)))
    yield Section("conclusions", "What came out", tuple(conclusions(divisions)))
    yield Section("caveats", "Read this before the tables", tuple(caveats(divisions)))
    if tables := tuple(tuning_tables(divisions)):
        text = (
            "Each controller beside itself on the same cranes. Red: more runs fail than before tuning, and "
            "the intervals of 95 % do not overlap. Green: fewer. All other differences may be chance."
        )
        yield Section("before-after", "Before and after tuning", (text,), tables)


def leading_division(divisions: Sequence[Judged]) -> Judged | None:
    """Return the division that the page begins with: the first that has runs of the reader, or any runs."""
    ranked = [judged for judged in divisions if judged.ranked_sets]
    return next(iter([*(judged for judged in ranked if judged.has_yours), *ranked]), None)


def conclusions(divisions: Sequence[Judged]) -> Iterator[str]:
    """Yield three sentences: who fails least, whether one is better than ours, and what tuning did."""
    if (leading := leading_division(divisions)) is None:
        return
    name = leading.ranked_sets[-1]
    first, *others = leading.ranking(name)
    best, next_best = shown_name(leading, first.controller), ""
    for second in others[:1]:
        numbers = f"{_percent(second.failed)} and {_percent(second.unsettled)}"
        next_best = f"; next is {shown_name(leading, second.controller)} with {numbers}"
    yield (
        f"On {name}, the set with the widest spread, {best} comes first: it fails in "
        f"{_percent(first.failed)} of {first.runs} runs and is unsettled for {_percent(first.unsettled)} of "
        f"the time at rest{next_best}."
    )
    yield _undominated(divisions)
    changes = tuning_changes(divisions)
    if not changes:
        yield "Controllers ran in one division only, so this page does not show what tuning changes."
        return
    name, of_set = list(changes.items())[-1]
    harmed = _harmed(of_set)
    examples = f", such as {', '.join(change.text for change in harmed[:MAX_EXAMPLES])}" if harmed else ""
    helped = sum(change.mark == "good" for change in of_set)
    yield (
        f"On {name}, tuning makes {len(harmed)} of {len(of_set)} controllers fail more than chance explains"
        f"{examples}, and {helped} fail less."
    )


def _undominated(divisions: Sequence[Judged]) -> str:
    """Tell which controller beats ours, and in what; without ours, who is undominated."""
    sets = [(judged, name) for judged in divisions for name in judged.ranked_sets]
    controllers = {standing.controller for judged, name in sets for standing in judged.ranking(name)}
    if OUR_CONTROLLER not in controllers:
        everywhere = set.intersection(*(judged.front(name) for judged, name in sets))
        who = Cell.listed(sorted(everywhere)) or "none"
        return f"Undominated in failures, unsettled time and effort on every set: {who}."
    for judged, name in sets:
        ranking = judged.ranking(name)
        for own in ranking:
            ahead = scores.dominates(points_of([own, *ranking]))[1:, 0]
            if own.controller == OUR_CONTROLLER and ahead.any():
                better = ranking[int(np.argmax(ahead))]
                return (
                    f"{better.controller} beats {OUR_CONTROLLER} (ours) on {name}, "
                    f"{TITLES[judged.division].lower()}: it fails in {_percent(better.failed)} of the runs, "
                    f"not {_percent(own.failed)}, is unsettled for {_percent(better.unsettled)} of the time, "
                    f"not {_percent(own.unsettled)}, and commands {better.effort:.3f} m/s², not "
                    f"{own.effort:.3f} m/s²."
                )
    return (
        f"No controller beats {OUR_CONTROLLER} (ours) on any set: none has as few failures, as short an "
        "unsettled time and as little effort, and is better in one of them."
    )


def caveats(divisions: Sequence[Judged]) -> Iterator[str]:
    """Yield what a reader should know before the tables, numbered."""
    (benchmark, table, *_), texts = divisions[0], list[str]()
    knowing = [name for name, facts in table.about["laws"].items() if "limits" in (facts["rig"] or ())]
    if OUR_CONTROLLER in table.about["laws"]:
        others = sorted(set(knowing) - {OUR_CONTROLLER})
        also = f", as do {Cell.listed(others)}" if others else ""
        number = len(table.about["laws"]) - len(knowing)
        limits = "The limits of the drives are offered to every controller. "
        limits += f"Ours uses them{also}; the other {number} do not."
        texts += [*MADE_BY_US[:2], limits, *MADE_BY_US[2:]]
    for name, changes in list(tuning_changes(divisions).items())[-1:]:
        if harmed := _harmed(changes):
            unseen = [
                scenario for scenario in benchmark.scenarios if scenario not in benchmark.tuning.scenarios
            ]
            text = f"Tuning harms {len(harmed)} of {len(changes)} controllers on {name}, in failures: "
            text += f"{', '.join(change.text for change in harmed)}."
            costly = [
                after.controller
                for before, after in changes
                if MAX_EFFORT_RATIO * before.effort < after.effort < inf
            ]
            text += f" It more than doubles the effort of {Cell.listed(costly)}." if costly else ""
            text += f" The tuning set never shows {Cell.listed(unseen)}." if unseen else ""
            texts.append(text)
    texts.append("The controllers of the literature are written by us. Their authors may do better.")
    if "lqr+hinf" in table.about["laws"]:
        texts.append(OF_THE_PROCESSOR)
    if (states := len({versions.get("sources") for versions in table.about["made_by"]})) > 1:
        texts.append(f"The runs come from {states} states of our sources.")
    yield from (f"{number}. {text}" for number, text in enumerate(texts, 1))


def tuning_changes(divisions: Sequence[Judged]) -> dict[str, list[TuningChange]]:
    """Return the controllers that two divisions have ranked on a set, by set, the widest spread last."""
    by_division = {judged.division: judged for judged in divisions}
    if len(by_division) < 2:
        return {}
    tuned, published = by_division["tuned"], by_division["published"]
    changes = {}
    for name in tuned.ranked_sets:
        before = {standing.controller: standing for standing in published.ranking(name)}
        after = [standing for standing in tuned.ranking(name) if standing.controller in before]
        changes[name] = [TuningChange(before[standing.controller], standing) for standing in after]
    return {name: of_set for name, of_set in changes.items() if of_set}


def tuning_tables(divisions: Sequence[Judged]) -> Iterator[Table]:
    """Yield a table for each set with each controller before and after tuning, the widest set first."""
    columns = ("failed %", "unsettled %", "RMS u")
    headings = (*NAMED, *(f"{column}\n{when}" for column in columns for when in ("before", "after")))
    changes = tuning_changes(divisions)
    for name, of_set in reversed(changes.items()):
        rows = []
        for change in of_set:
            before, after = (f"{100.0 * standing.failed:.1f}" for standing in change)
            unsettled = (f"{100.0 * standing.unsettled:.1f}" for standing in change)
            effort = (finite(standing.effort, ".2f", "fails") for standing in change)
            marked = before, Cell(after, change.mark)
            rows.append(Cell.row(*named(divisions[0], change.after.controller), *marked, *unsettled, *effort))
        folded = name != list(changes)[-1]
        yield Table(f"Cranes: {name}", headings, tuple(rows), labels=2, note=EFFORT_UNIT, folded=folded)


def _harmed(changes: Sequence[TuningChange]) -> list[TuningChange]:
    """Return those that fail more after tuning, beyond chance; the largest change first."""
    harmed = [change for change in changes if change.mark == "bad"]
    return sorted(harmed, key=lambda change: change.before.failed - change.after.failed)


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
