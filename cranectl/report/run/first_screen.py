"""The first screen of a page of logs: the verdict, the numbers that matter, the crane at its worst moment."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import degrees

import numpy as np
from PIL.Image import Image

from cranectl.cases import JudgedValue, RunSummary, drive_uses
from cranectl.compare import Agreement
from cranectl.metrics import LimitVerdict, RunMetrics
from cranectl.plants import PLANTS
from cranectl.report.page import Fact, Figure, FirstScreen
from cranectl.report.run.differences import Logs, LogTables
from cranectl.report.table import Cell, Table
from cranectl.simulate import Run
from cranectl.support import Array, Quantity

Summaries = Mapping[str, Sequence[RunSummary]]  # by label of the log
Agreements = Mapping[str, Sequence[Agreement]]  # by label of the log

BADGES = {True: Cell("PASS", "good"), False: Cell("FAIL", "bad"), None: Cell.verdict(None)}
AGREEMENT_ONLY = Cell("PLANTS AGREE", "good")  # where no limits are set, nobody judges the controller
MAX_FAULTS = 3  # limits that the verdict names
MIN_SHOWN_MM = 1e-3  # [mm] of an error that is shown


def first_screen_of(
    logs: Logs, summaries: Summaries, agreements: Agreements, worst: Mapping[str, tuple[float, Image]]
) -> FirstScreen:
    """Return the first screen; `worst` holds by log the time and the picture of its worst moment."""
    passed, reason = verdict_on(logs, summaries, agreements)
    judged = [agreement for of_log in agreements.values() for agreement in of_log]
    badge = BADGES[passed]
    if passed and any(agreement.passed for agreement in judged) and not _limits_of(summaries):
        # Nobody may judge how far a user's own plant is from the others.
        leaves_open_own = any(a.passed is None and not PLANTS.entry(a.plant).is_own for a in judged)
        badge = BADGES[None] if leaves_open_own else AGREEMENT_ONLY
    facts = {label: _facts(log, summaries[label], agreements[label]) for label, log in logs.items()}
    figures = tuple(_worst_moment(label, logs, *moment) for label, moment in worst.items())
    if len(logs) == 1:
        (numbers,) = facts.values()
        return FirstScreen(badge, reason, numbers, (LogTables.what_was_run(logs),), figures)
    values = [{fact.name: Cell(fact.value, fact.mark) for fact in of_log} for of_log in facts.values()]
    names = dict.fromkeys(name for of_log in values for name in of_log)
    rows = tuple(Cell.row(name, *(of_log.get(name, "–") for of_log in values)) for name in names)
    tables = Table("", ("", *logs), rows), LogTables.what_differs(logs)
    return FirstScreen(badge, reason, (), tuple(filter(None, tables)), figures)


def _worst_moment(label: str, logs: Logs, time: float, picture: Image) -> Figure:
    log, shown = logs[label], PLANTS.entry(PLANTS.shown(logs[label]))
    title = f"the crane at its worst moment{f', {label}' if len(logs) > 1 else ''}"
    follows = all(run.has_reference for run in log.values())
    worst = "is farthest from its reference" if follows else "swings most"
    whose = "" if shown.is_own or len(log) == 1 else f" of {shown.label}"
    return Figure.pictured(title, f"At {time:.2f} s the load{whose} {worst}.", picture)


def verdict_on(logs: Logs, summaries: Summaries, agreements: Agreements) -> tuple[bool | None, str]:
    """Return whether the logs pass, None if nothing is judged, and the reason in words."""
    judged = [agreement for of_log in agreements.values() for agreement in of_log]
    limits = _limits_of(summaries)
    faults = [*_unexpected_ends(logs), *_disagreements(agreements), *_broken_limits(limits)]
    if faults:
        return False, _sentences(faults)
    good = [*_agreements(judged, len(logs))]
    runs = [run for log in logs.values() for run in log.values()]
    if stopped := [run for run in runs if run.status.stopped]:
        how = ", ".join(dict.fromkeys(run.status.label for run in stopped))
        good.insert(0, f"{'the runs stop' if len(stopped) > 1 else 'the run stops'} with {how}, as expected")
    if limits:
        good.append(f"{'all ' if len(limits) > 1 else 'the '}{_count(len(limits), 'limit')} kept")
    open_points = [*_reasons(judged)]
    if good and not limits:
        open_points.append(
            "no limits are set: the table [limits] of the scenario adds a verdict on the controller"
        )
    if not good and not judged:
        alone = "each run has one plant" if len(logs) > 1 else "only one plant was run"
        why = f"{alone}, and the scenario sets no limits"
        if not all(run.has_reference for run in runs):
            why = "the run has no reference"
        open_points = [f"{why}: there is nothing to judge"]
    return (True if good else None), _sentences([", and ".join(good), *open_points])


def agreement_sentence(agreements: Agreements) -> str:
    """Return one sentence on whether the plants of all logs agree, or why nobody judges that."""
    judged = [agreement for of_log in agreements.values() for agreement in of_log]
    faults = [*_disagreements(agreements)]
    return _sentences([*(faults or _agreements(judged, len(agreements))), *_reasons(judged)])


def _limits_of(summaries: Summaries) -> list[tuple[str, LimitVerdict]]:
    """Return each limit of each log once, with its label; the one farthest from being kept comes first.

    Any value is infinitely far from a limit of zero, which therefore comes after the other broken ones.
    """
    limits = [(a, limit) for a, runs in summaries.items() for _, limit in RunSummary.judged_limits(runs)]
    return sorted(limits, key=lambda pair: (pair[1].kept, pair[1].limit == 0.0, -pair[1].overrun))


def _sentences(statements: Iterable[str]) -> str:
    return " ".join(f"{text[0].upper()}{text[1:]}." for text in statements if text)


def _count(number: int, what: str) -> str:
    return f"{number} {what}s are" if number > 1 else f"{what} is"


def _unexpected_ends(logs: Logs) -> Iterator[str]:
    for label, log in logs.items():
        for run in log.values():
            if not run.ended_as_expected:
                where = run.plant if len(logs) == 1 else f"{label}, {run.plant}"
                expected = run.scenario.expected
                rest = "" if expected == "completed" else f"; expected was {expected}"
                yield f"the run on {where} ended at {run.end_s:g} s with {run.status.label}{rest}"


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
            return f"their {what} differ by {Quantity(value, unit)} (allowed: {Quantity(limit, unit)})"
    return "they end in different ways, or at different times"


def _agreements(judged: Sequence[Agreement], logs: int) -> Iterator[str]:
    passed = [agreement for agreement in judged if agreement.passed and agreement.limit_m]
    if passed:
        nearest = max(passed, key=lambda agreement: agreement.max_load_error_m / (agreement.limit_m or 1.0))
        where = f" in all {logs} logs" if logs > 1 and len(passed) == len(judged) else ""
        plants = PLANTS.in_order({a.plant for a in passed} | {a.reference for a in passed})
        who = "the plants" if len(passed) == len(judged) or logs > 1 else " and ".join(plants)
        text, allowed = (
            Quantity(nearest.max_load_error_m, "m").difference(),
            Quantity(nearest.limit_m or 0.0, "m").text(),
        )
        at_most = f"less than {text[2:]}" if text.startswith("<") else f"at most {text}"
        yield f"{who} agree{where}: their loads differ by {at_most} (allowed: {allowed})"


def _reasons(judged: Sequence[Agreement]) -> Iterator[str]:
    """Say what is not judged, and why, once for each reason."""
    for why in dict.fromkeys(agreement.limits for agreement in judged if agreement.passed is None):
        yield f"the difference between the plants is not judged: {why}"


def _broken_limits(limits: Sequence[tuple[str, LimitVerdict]]) -> Iterator[str]:
    broken = [pair for pair in limits if not pair[1].kept]
    if broken:
        label, worst = broken[0]
        faults = [JudgedValue.of_limit(worst).fault]
        whose = f"{label}, " if len({label for label, _ in limits}) > 1 else ""
        if not whose:  # of several runs, the page has a table
            faults = [JudgedValue.of_limit(limit).fault for _, limit in broken[:MAX_FAULTS]]
        fault = "; ".join(f"{text[0].lower()}{text[1:]}".rstrip(".") for text in faults)
        many = f"{len(broken)} of {_count(len(limits), 'limit')}" if len(limits) > 1 else "the limit is"
        yield f"{many} broken: {whose}{fault}"


def _facts(
    log: Mapping[str, Run], summaries: Sequence[RunSummary], agreements: Sequence[Agreement]
) -> tuple[Fact, ...]:
    """Return the numbers of one log: of the user's own plant, if any, beside those of the reference plant."""
    shown, reference = PLANTS.shown(log), PLANTS.reference(log)
    facts = [*_facts_of(log[shown], summaries)]
    beside = {} if shown == reference else {f.name: f.value for f in _facts_of(log[reference], summaries)}
    if beside:
        own, other = PLANTS.entry(shown).label, PLANTS.entry(reference).label
        remarks = [f"{own}: {fact.remark}; {other}: {beside.get(fact.name, '–')}" for fact in facts]
        facts = [replace(fact, remark=remark) for fact, remark in zip(facts, remarks, strict=True)]
    if log[shown].has_reference and facts:
        facts.insert(2, _plant_difference(log, agreements))
    return tuple(facts)


def _facts_of(run: Run, summaries: Sequence[RunSummary]) -> Iterator[Fact]:
    """Yield the numbers of one run, those that it has samples for."""
    summary = next(summary for summary in summaries if summary.plant == run.plant)
    metrics = summary.metrics
    if run.has_reference:
        if metrics is not None:
            distance = np.linalg.norm(run.load_position - run.reference_position, axis=1)
            limits = [limit for limit in summary.limits if limit.metric == "max_error_m"]
            allowed = "".join(f"; allowed: {_millimetres(limit.limit)}" for limit in limits)
            mark = "" if all(limit.kept for limit in limits) else "bad"
            error, when = _millimetres(metrics.max_error_m), f"{_when(run, distance)}{allowed}"
            yield Fact("Largest tracking error", error, when, mark)
            yield _sway(run, metrics)
            yield _drive_use(run, metrics)
        return
    if run.has("residual"):  # of a prediction from the measured crane
        distance = run.load_residual
        largest = _millimetres(float(distance.max()))
        yield Fact("Load, measured minus predicted", largest, _when(run, distance))
    if run.has("state"):
        angles = np.abs(run.angles).max(axis=1)
        yield Fact("Largest angle", _degrees(float(angles.max())), _when(run, angles))


def _when(run: Run, values: Array) -> str:
    """Return the time of the largest value in words."""
    return f"at {run.time[int(np.argmax(values))]:.2f} s"


def _millimetres(length: float) -> str:
    """Return a length [m] in mm with three digits, from a metre on in m."""
    if length >= 1.0:
        return f"{length:.3g} m"
    size = 1e3 * length
    if 0.0 < size < MIN_SHOWN_MM:
        return f"< {MIN_SHOWN_MM:g} mm"
    return f"{size:.0f} mm" if size >= 100.0 else f"{size:.3g} mm"


def _sway(run: Run, metrics: RunMetrics) -> Fact:
    if metrics.residual_sway_rad is None:
        return Fact("Largest sway", _degrees(metrics.max_sway_rad), "the run ends before its reference rests")
    settles = metrics.settling_time_s
    how = "does not settle" if settles is None else f"{settles:.2f} s to settle"
    remark = f"{how} to {_millimetres(run.scenario.metrics.settling_tolerance)}"
    return Fact("Sway after the motion", _degrees(metrics.residual_sway_rad), remark)


def _degrees(angle: float) -> str:
    shown = degrees(angle)
    return "< 0.01°" if 0.0 < shown < 0.01 else f"{shown:.2f}°"


def _plant_difference(log: Mapping[str, Run], agreements: Sequence[Agreement]) -> Fact:
    name = "Difference between plants"
    if not agreements:
        return Fact(name, "–", f"only one plant to compare: {', '.join(log)}")
    largest = max(agreements, key=lambda agreement: agreement.max_load_error_m)
    remark = "not judged" if largest.limit_m is None else f"allowed: {Quantity(largest.limit_m, 'm')}"
    mark = "bad" if any(agreement.passed is False for agreement in agreements) else ""
    return Fact(name, Quantity(largest.max_load_error_m, "m").difference(), remark, mark)


def _drive_use(run: Run, metrics: RunMetrics) -> Fact:
    use = drive_uses(run)[0]
    what = {"m/s": "speed", "N": "force"}.get(use.unit, "acceleration")
    remark = f"{use.axis}: {what} {use.commanded:.2g} of {use.limit:.2g} {use.unit}"
    remark += " (assumed)" if use.is_assumed else ""
    remark += ", which this run does not limit" if run.scenario.effects.limits is None else ""
    remark += f"; at a limit for {metrics.saturated_s:.2g} s" if metrics.saturated_s else ""
    return Fact("Drive use", f"{100.0 * use.share:.0f} %", remark, "bad" if use.share > 1.0 else "")
