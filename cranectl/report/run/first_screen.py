"""The first screen of a page of logs: the verdict, the numbers that matter, the crane at its worst moment."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import degrees

import numpy as np
from PIL.Image import Image

from cranectl.cases.case import RunSummary, judged_limits
from cranectl.cases.drive_use import drive_uses
from cranectl.compare.agreement import Agreement, ended_as_expected
from cranectl.metrics import RunMetrics, all_metrics
from cranectl.metrics.limits import LimitVerdict
from cranectl.plants.registry import in_order, plant_entry, reference_plant, shown_plant
from cranectl.report.page import Fact, Figure, FirstScreen
from cranectl.report.run.differences import Logs, what_differs, what_was_run
from cranectl.report.table import VERDICTS, Cell, Table, cells
from cranectl.simulate import Run
from cranectl.support.units import difference_in, quantity

Summaries = Mapping[str, Sequence[RunSummary]]  # by label of the log
Agreements = Mapping[str, Sequence[Agreement]]  # by label of the log

BADGES = {True: Cell("PASS", "good"), False: Cell("FAIL", "bad"), None: VERDICTS[None]}
AGREEMENT_ONLY = Cell("PLANTS AGREE", "good")  # where no limits are set, nobody judges the controller
MIN_SHOWN_MM = 1e-3  # [mm] of an error that is shown


def first_screen_of(
    logs: Logs, summaries: Summaries, agreements: Agreements, worst: Mapping[str, tuple[float, Image]]
) -> FirstScreen:
    """Return the first screen; `worst` holds by log the time and the picture of its worst moment."""
    passed, reason = verdict_on(logs, summaries, agreements)
    compared = any(agreement.passed for of_log in agreements.values() for agreement in of_log)
    badge = BADGES[passed]
    if passed and compared and not _limits_of(summaries):
        badge = BADGES[None] if _leaves_open_own(agreements) else AGREEMENT_ONLY
    facts = {label: _facts(log, summaries[label], agreements[label]) for label, log in logs.items()}
    figures = tuple(_worst_moment(label, logs, *moment) for label, moment in worst.items())
    if len(logs) == 1:
        (numbers,) = facts.values()
        return FirstScreen(badge, reason, numbers, (what_was_run(logs),), figures)
    values = [{fact.name: Cell(fact.value, fact.mark) for fact in of_log} for of_log in facts.values()]
    names = dict.fromkeys(name for of_log in values for name in of_log)
    rows = tuple(cells(name, *(of_log.get(name, "–") for of_log in values)) for name in names)
    tables = Table("", ("", *logs), rows), what_differs(logs)
    return FirstScreen(badge, reason, (), tuple(filter(None, tables)), figures)


def _leaves_open_own(agreements: Agreements) -> bool:
    """Return True if nobody judges how far a user's own plant is from the others."""
    judged = [agreement for of_log in agreements.values() for agreement in of_log]
    return any(a.passed is None and not plant_entry(a.plant).is_own for a in judged)


def _worst_moment(label: str, logs: Logs, time: float, picture: Image) -> Figure:
    several = len(logs) > 1
    title = f"the crane at its worst moment{f', {label}' if several else ''}"
    follows = all(run.has_reference for run in logs[label].values())
    worst = "is farthest from its reference" if follows else "swings most"
    shown = shown_plant(logs[label])
    whose = "" if plant_entry(shown).is_own or len(logs[label]) == 1 else f" of {plant_entry(shown).label}"
    caption = f"At {time:.2f} s the load{whose} {worst}."
    return Figure.pictured(title, caption, picture)


def verdict_on(logs: Logs, summaries: Summaries, agreements: Agreements) -> tuple[bool | None, str]:
    """Return whether the logs pass, None if nothing is judged, and the reason in words."""
    judged = [agreement for of_log in agreements.values() for agreement in of_log]
    limits = _limits_of(summaries)
    faults = [*_unexpected_ends(logs), *_disagreements(agreements), *_broken_limits(limits)]
    if faults:
        return False, _sentences(faults)
    good = [*_expected_stops(logs), *_agreements(judged, len(logs))]
    if limits:
        good.append(f"{'all ' if len(limits) > 1 else 'the '}{_count(len(limits), 'limit')} kept")
    open_points = [*_reasons(judged)]
    if not good and not judged:
        alone = "each run has one plant" if len(logs) > 1 else "only one plant was run"
        if not all(run.has_reference for log in logs.values() for run in log.values()):
            open_points = ["the run has no reference: there is nothing to judge"]
        else:
            open_points = [f"{alone}, and the scenario sets no limits: there is nothing to judge"]
    return (True if good else None), _sentences([", and ".join(good), *open_points])


def agreement_sentence(agreements: Agreements) -> str:
    """Return one sentence on whether the plants of all logs agree, or why nobody judges that."""
    judged = [agreement for of_log in agreements.values() for agreement in of_log]
    faults = [*_disagreements(agreements)]
    return _sentences([*(faults or _agreements(judged, len(agreements))), *_reasons(judged)])


def _limits_of(summaries: Summaries) -> list[LimitVerdict]:
    """Return each limit of each log once; the one that is farthest from being kept comes first."""
    limits = [limit for runs in summaries.values() for _, limit in judged_limits(runs)]
    return sorted(limits, key=lambda limit: (limit.kept, -limit.overrun))


def _sentences(statements: Iterable[str]) -> str:
    return " ".join(f"{text[0].upper()}{text[1:]}." for text in statements if text)


def _count(number: int, what: str) -> str:
    return f"{number} {what}s are" if number > 1 else f"{what} is"


def _unexpected_ends(logs: Logs) -> Iterator[str]:
    for label, log in logs.items():
        for run in log.values():
            if not ended_as_expected(run):
                where = run.plant if len(logs) == 1 else f"{label}, {run.plant}"
                expected = run.scenario.expected
                rest = "" if expected == "completed" else f"; expected was {expected}"
                yield f"the run on {where} ended at {run.end_s:g} s with {run.status.label}{rest}"


def _expected_stops(logs: Logs) -> Iterator[str]:
    stopped = [run for log in logs.values() for run in log.values() if run.status.stopped]
    if stopped:
        how = ", ".join(dict.fromkeys(run.status.label for run in stopped))
        yield f"{'the runs stop' if len(stopped) > 1 else 'the run stops'} with {how}, as expected"


def _disagreements(agreements: Agreements) -> Iterator[str]:
    for label, of_log in agreements.items():
        where = f" in {label}" if len(agreements) > 1 else ""
        for agreement in of_log:
            if agreement.passed is False:
                plants = f"{agreement.plant} and {agreement.reference}"
                yield f"{plants} disagree{where}: {_excess(agreement)}"


def _excess(agreement: Agreement) -> str:
    """Return by what two plants differ too much."""
    pairs = (
        ("loads", agreement.max_load_error_m, agreement.limit_m, "m"),
        ("angles", agreement.max_angle_error_rad, agreement.limit_rad, "rad"),
    )
    for what, value, limit, unit in pairs:
        if limit is not None and not value <= limit:
            return f"their {what} differ by {quantity(value, unit)} (allowed: {quantity(limit, unit)})"
    return "they end in different ways, or at different times"


def _agreements(judged: Sequence[Agreement], logs: int) -> Iterator[str]:
    passed = [agreement for agreement in judged if agreement.passed and agreement.limit_m]
    if passed:
        nearest = max(passed, key=lambda agreement: agreement.max_load_error_m / (agreement.limit_m or 1.0))
        where = f" in all {logs} logs" if logs > 1 and len(passed) == len(judged) else ""
        plants = in_order({a.plant for a in passed} | {a.reference for a in passed})
        who = "the plants" if len(passed) == len(judged) or logs > 1 else " and ".join(plants)
        yield (
            f"{who} agree{where}: their loads differ by {_at_most(nearest)} "
            f"(allowed: {quantity(nearest.limit_m or 0.0, 'm')})"
        )


def _at_most(agreement: Agreement) -> str:
    text = difference_in(agreement.max_load_error_m, "m")
    return f"less than {text[2:]}" if text.startswith("<") else f"at most {text}"


def _reasons(judged: Sequence[Agreement]) -> Iterator[str]:
    """Say what is not judged, and why, once for each reason."""
    for why in dict.fromkeys(agreement.limits for agreement in judged if agreement.passed is None):
        yield f"the difference between the plants is not judged: {why}"


def _broken_limits(limits: Sequence[LimitVerdict]) -> Iterator[str]:
    broken = [limit for limit in limits if not limit.kept]
    if broken:
        (value, limit), name = broken[0].texts, broken[0].metric
        unit = next(metric.unit for metric in all_metrics() if metric.name == name)
        many = f"{len(broken)} of {_count(len(limits), 'limit')}" if len(limits) > 1 else "the limit is"
        yield f"{many} broken: {name} is {value or 'missing'} {unit}, its limit is {limit} {unit}"


def _facts(
    log: Mapping[str, Run], summaries: Sequence[RunSummary], agreements: Sequence[Agreement]
) -> tuple[Fact, ...]:
    """Return the numbers of one log: of the user's own plant, if any, beside those of the reference plant."""
    shown, reference = shown_plant(log), reference_plant(log)
    facts, difference = _facts_of(log[shown], summaries), _plant_difference(log, agreements)
    beside = {} if shown == reference else {f.name: f.value for f in _facts_of(log[reference], summaries)}
    if beside:
        own, other = plant_entry(shown).label, plant_entry(reference).label
        facts = [
            replace(fact, remark=f"{own}: {fact.remark}; {other}: {beside.get(fact.name, '–')}")
            for fact in facts
        ]
    compared = (difference,) if log[shown].has_reference and facts else ()
    return (*facts[:2], *compared, *facts[2:])


def _facts_of(run: Run, summaries: Sequence[RunSummary]) -> list[Fact]:
    """Return the numbers of one run, those that it has samples for."""
    summary = next(summary for summary in summaries if summary.plant == run.plant)
    if not run.has_reference:
        return list(_facts_without_reference(run))
    if summary.metrics is None:
        return []
    return [
        _tracking_error(run, summary, summary.metrics),
        _sway(run, summary.metrics),
        _drive_use(run, summary.metrics),
    ]


def _facts_without_reference(run: Run) -> Iterator[Fact]:
    """Yield what separates a prediction from the measured crane, and the largest angle."""
    if run.has("residual"):
        distance = np.linalg.norm(run.block("residual")[:, 5:], axis=1)
        when = float(run.time[int(np.argmax(distance))])
        yield Fact("Load, measured minus predicted", _millimetres(float(distance.max())), f"at {when:.2f} s")
    if run.has("state"):
        largest = np.abs(run.angles).max(axis=1)
        when = float(run.time[int(np.argmax(largest))])
        yield Fact("Largest angle", _degrees(float(largest.max())), f"at {when:.2f} s")


def _tracking_error(run: Run, summary: RunSummary, metrics: RunMetrics) -> Fact:
    distance = np.linalg.norm(run.load_position - run.reference[:, :3], axis=1)
    when = float(run.time[int(np.argmax(distance))])
    limits = [limit for limit in summary.limits if limit.metric == "max_error_m"]
    allowed = "".join(f"; allowed: {_millimetres(limit.limit)}" for limit in limits)
    mark = "" if all(limit.kept for limit in limits) else "bad"
    return Fact(
        "Largest tracking error", _millimetres(metrics.max_error_m), f"at {when:.2f} s{allowed}", mark
    )


def _millimetres(length: float) -> str:
    """Return a length [m] in mm with three digits, whatever its size."""
    size = 1e3 * length
    if 0.0 < size < MIN_SHOWN_MM:
        return f"< {MIN_SHOWN_MM:g} mm"
    return f"{size:.0f} mm" if size >= 100.0 else f"{size:.3g} mm"


def _sway(run: Run, metrics: RunMetrics) -> Fact:
    if metrics.residual_sway_rad is None:
        return Fact("Largest sway", _degrees(metrics.max_sway_rad), "the run ends before its reference rests")
    tolerance = _millimetres(run.scenario.metrics.settling_tolerance)
    settles = metrics.settling_time_s
    remark = (
        f"does not settle to {tolerance}" if settles is None else f"{settles:.2f} s to settle to {tolerance}"
    )
    return Fact("Sway after the motion", _degrees(metrics.residual_sway_rad), remark)


def _degrees(angle: float) -> str:
    shown = degrees(angle)
    return "< 0.01°" if 0.0 < shown < 0.01 else f"{shown:.2f}°"


def _plant_difference(log: Mapping[str, Run], agreements: Sequence[Agreement]) -> Fact:
    name = "Difference between plants"
    if not agreements:
        return Fact(name, "–", f"only one plant to compare: {', '.join(log)}")
    largest = max(agreements, key=lambda agreement: agreement.max_load_error_m)
    remark = "not judged" if largest.limit_m is None else f"allowed: {quantity(largest.limit_m, 'm')}"
    mark = "bad" if any(agreement.passed is False for agreement in agreements) else ""
    return Fact(name, difference_in(largest.max_load_error_m, "m"), remark, mark)


def _drive_use(run: Run, metrics: RunMetrics) -> Fact:
    use = drive_uses(run)[0]
    what = "speed" if use.unit == "m/s" else "acceleration"
    remark = f"{use.axis}: {what} {use.commanded:.2g} of {use.limit:.2g} {use.unit}"
    if use.is_assumed:
        remark += " (assumed)"
    if run.scenario.effects.limits is None:
        remark += ", which this run does not limit"
    if metrics.saturated_s:
        remark += f"; at a limit for {metrics.saturated_s:.2g} s"
    return Fact("Drive use", f"{100.0 * use.share:.0f} %", remark, "bad" if use.share > 1.0 else "")
