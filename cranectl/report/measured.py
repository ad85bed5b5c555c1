"""Tables, figures and pages of measured cranes: identified numbers, and verdicts on new runs."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure as Drawing

from cranectl.measured.comparison import BLOCK_SAMPLES, ReadingsComparison
from cranectl.measured.experiment import ANGLE_DELAY, ANGLE_SCALE, CHECK, MODEL
from cranectl.measured.identification import MAX_MISFIT, Estimate, Identification
from cranectl.measured.verdict import (
    BAND_DEVIATIONS,
    COVERED,
    FALSE_ALARMS,
    NOT_COVERED,
    NOT_DECIDED,
    WITHIN_TOLERANCE,
    RunVerdict,
)
from cranectl.report.page import Fact, Figure, FirstScreen, Page, Section
from cranectl.report.table import Cell, Table, tabulate
from cranectl.report.theme import SERIES, STAND_IN, TIME, WIDTH, canvas, make_room
from cranectl.support.units import quantity

MARKS = {COVERED: "good", WITHIN_TOLERANCE: "open", NOT_DECIDED: "open", NOT_COVERED: "bad"}  # worst last
MILLIMETRES = 1e3
CHANNEL_LABELS = {
    "bridge_position": "bridge",
    "trolley_position": "trolley",
    "rope_length": "rope",
    "alpha": "α, at the load",
    "beta": "β, at the load",
}
INTERVALS_CAPTION = (
    "The 95 % interval of each number, as a share of its value. Dark: the standard deviation between runs. "
    "Pale: the whole interval, with the errors that all runs share."
)
RESIDUALS_CAPTION = (
    "Left: measured and fitted. Right: measured minus fitted, and the band of what encoders add."
)


def estimates_table(estimates: Sequence[Estimate], title: str, note: str = "") -> Table:
    """Return numbers of the crane with their intervals, and what the intervals come from."""
    columns: dict[str, Callable[[Estimate], Cell | str]] = {
        "number": lambda e: e.name.removeprefix("effects."),
        "unit": lambda e: e.unit,
        "value": lambda e: f"{e.value:.5g}",
        "± (95 %)": lambda e: f"{e.half_width:.2g}",
        "spread of runs": lambda e: f"{e.spread:.2g}",
        "encoders": lambda e: f"{e.encoders:.2g}",
        "to MuJoCo": lambda e: f"{e.model_error:.2g}",
    }
    return tabulate(title, estimates, columns, labels=2, note=note)


def identified_table(result: Identification) -> Table:
    """Return the fitted numbers, and how well the model repeats the runs."""
    title = f"Identified from the {result.replay} of {result.runs} runs"
    note = f"Residuals over noise, squared: {result.misfit:.3g}"
    return estimates_table(result.estimates, title, note)


def remarks(result: Identification) -> list[str]:
    """Return in words what the runs leave open, and whether the model fits them."""
    sentences = []
    if result.unidentifiable:
        sentences.append(f"not identifiable from these logs: {', '.join(result.unidentifiable)}")
    for a, b, correlation in result.correlated:
        sentences.append(f"{a} and {b} can replace one another here: correlation {correlation:.3f}")
    sensor = {e.name: e for e in result.estimates}
    scale, delay = sensor.get(ANGLE_SCALE), sensor.get(ANGLE_DELAY)
    if scale is not None and abs(scale.value - 1.0) > scale.half_width:
        factor = f"multiply the scale of alpha and beta in the map by {1.0 / scale.value:.3f}"
        sentences.append(f"angles are read as {scale.value:.3f} of what they are: {factor}")
    if delay is not None and abs(delay.value) > delay.half_width:
        more = f"add {delay.value:.4g} to the delay of alpha and beta in the map"
        sentences.append(f"angles are {1e3 * delay.value:.3g} ms late: {more}")
    rope = sensor.get("effects.installation.rope_offset")
    if scale is not None and rope is not None and abs(rope.value) > rope.half_width:
        wrong = f"{MILLIMETRES * abs(rope.value):.3g} mm too {'long' if rope.value > 0.0 else 'short'}"
        advice = f"add {rope.value:.4g} to the zero of rope_length in the map"
        sentences.append(f"the rope is read {wrong}: {advice}")
    if result.converged and (lasting := max(c.misfit for c in result.comparisons)) > MAX_MISFIT:
        sentences.append(
            f"residuals last: as means over {BLOCK_SAMPLES} samples they are up to {lasting:.3g} times the "
            "squared noise of such means. If readings drift, as of a camera, intervals are too narrow"
        )
    if not result.converged:
        sentences.append(
            f"NOT CONVERGED: the residuals are {result.misfit:.3g} times the squared noise of the readings, "
            f"and {MAX_MISFIT:g} is allowed. The crane does something that the model does not."
        )
    return sentences


def identification_page(result: Identification, names: Sequence[str], remade_by: str) -> Page:
    """Return the page of an identification from the logs of these names."""
    badge = Cell("NOT CONVERGED", "bad")
    reason = "The model does not repeat the fitted runs, so its numbers mean little."
    if result.converged:
        badge = Cell("fitted", "good")
        reason = "The residuals are as large as the stated noise of the readings."
    largest = max(comparison.largest for comparison in result.comparisons)
    facts = (
        Fact("Runs", str(result.runs), f"{result.replay} repeated on the plant {MODEL}"),
        Fact("Numbers", str(len(result.estimates)), f"{len(result.unidentifiable)} more are left open"),
        Fact("Residuals over noise, squared", f"{result.misfit:.3g}", f"allowed: {MAX_MISFIT:g}"),
        Fact("Largest residual", quantity(largest, "m"), "as means over 25 samples"),
    )
    texts = tuple(f"{remark[0].upper()}{remark[1:]}." for remark in remarks(result))
    intervals = Figure.drawn("Intervals", INTERVALS_CAPTION, _intervals_figure, result, alone=True)
    numbers = Section("numbers", "Numbers", texts, (identified_table(result),), (intervals,))
    residuals = [
        Figure.drawn(name, RESIDUALS_CAPTION, _comparison_figure, comparison, "fitted", alone=True)
        for name, comparison in zip(names, result.comparisons, strict=True)
    ]
    sections = (numbers, Section("residuals", "Residuals", figures=tuple(residuals)))
    lead = f"Fitted to {', '.join(names)}. Intervals: spread between runs, and a comparison with {CHECK}."
    return Page("Identified crane", lead, sections, remade_by, FirstScreen(badge, reason, facts))


def verdict_table(verdicts: Sequence[RunVerdict]) -> Table:
    """Return the answers, and where each run differs most clearly."""
    columns: dict[str, Callable[[RunVerdict], Cell | str]] = {
        "log": lambda v: v.name,
        "answer": lambda v: Cell(v.answer, MARKS[v.answer]),
        "largest [mm]": lambda v: f"{MILLIMETRES * v.comparison.largest:.2f}",
        "band ± [mm]": lambda v: f"{MILLIMETRES * v.band:.2f}",
        "clearest in": lambda v: v.channel,
        "at [s]": lambda v: f"{v.time:.2f}",
        "times its σ": lambda v: f"{v.statistic:.1f}",
        "p": lambda v: f"{v.probability:.3f}",
    }
    return tabulate("Measured minus predicted, runs that were not used", verdicts, columns, labels=2)


def verdict_sentence(verdicts: Sequence[RunVerdict]) -> str:
    """Return what was shown, and how often the verdict errs."""
    covered, runs = sum(verdict.answer == COVERED for verdict in verdicts), len(verdicts)
    rate = f"{100 * FALSE_ALARMS:g} %"
    errs = f"A model without error is called not covered in at most {rate} of such verdicts."
    if covered < runs:
        return f"{covered} of {runs} runs are covered. {errs}"
    share = FALSE_ALARMS ** (1.0 / runs)
    return f"All runs are covered: so are at least {100 * share:.0f} % of such motions, at 95 %. {errs}"


def fault_of(verdict: RunVerdict) -> str:
    """Return in a sentence why a run is not covered, or not decided."""
    if verdict.answer == NOT_DECIDED:
        band = quantity(verdict.band, "m")
        return f"not decided: the band of ± {band} is wider than the tolerance, or the fit did not converge"
    block, channel = verdict.worst
    size = quantity(abs(float(verdict.comparison.difference[block, channel])), "m")
    largest = quantity(verdict.comparison.largest, "m")
    return (
        f"{verdict.answer}: at {verdict.time:.2f} s {verdict.channel} differs by {size}, "
        f"{verdict.statistic:.1f} standard deviations; the largest difference is {largest}"
    )


def verdict_page(verdicts: Sequence[RunVerdict], tolerance: float | None, remade_by: str) -> Page:
    """Return the page of verdicts on measured runs, with `tolerance` [m] if one is accepted."""
    worst = max(verdicts, key=lambda verdict: [*MARKS].index(verdict.answer))
    farthest = max(verdicts, key=lambda verdict: verdict.comparison.largest)
    covered = sum(verdict.answer == COVERED for verdict in verdicts)
    accepted = "none stated" if tolerance is None else f"accepted: {quantity(tolerance, 'm')}"
    probability = f"{100.0 * min(v.probability for v in verdicts):.2g} %"
    facts = (
        Fact("Runs covered", f"{covered} of {len(verdicts)}"),
        Fact("Largest difference", quantity(farthest.comparison.largest, "m"), accepted),
        Fact("Widest band", f"± {quantity(max(v.band for v in verdicts), 'm')}", "of the predictions"),
        Fact("Smallest probability", probability, "that a model without error differs as much"),
    )
    caption = (
        f"Left: measured and predicted. Right: measured minus predicted, and ± {BAND_DEVIATIONS:g} standard "
        "deviations that the identified crane leaves open."
    )
    sections = [Section("answers", "Answers", tables=(verdict_table(verdicts),))]
    for number, verdict in enumerate(verdicts, 1):
        data = verdict.comparison, "predicted", tolerance
        drawn = Figure.drawn(verdict.name, caption, _comparison_figure, *data, alone=True)
        why = () if verdict.answer == COVERED else (f"{fault_of(verdict).capitalize()}.",)
        title = f"{verdict.answer}: {verdict.name}"
        sections.append(Section(f"run-{number}", title, why, figures=(drawn,)))
    first = FirstScreen(Cell(worst.answer, MARKS[worst.answer]), verdict_sentence(verdicts), facts)
    lead = "Nothing was fitted to these runs. Each was predicted from where the crane rested."
    return Page("Does the model cover the crane?", lead, tuple(sections), remade_by, first)


def _comparison_figure(comparison: ReadingsComparison, label: str, tolerance: float | None = None) -> Drawing:
    """Draw a run with its prediction, and beside it the difference with its band; a row for each channel."""
    rows = len(comparison.channels)
    figure, grid = canvas(1.5 * WIDTH, 0.7 + 1.25 * rows, rows, 2, sharex=True, squeeze=False)
    band = BAND_DEVIATIONS * comparison.deviation * MILLIMETRES
    for k, (name, (run, difference)) in enumerate(zip(comparison.channels, grid, strict=True)):
        time, blue, orange = comparison.time, STAND_IN[SERIES[0]], STAND_IN[SERIES[1]]
        run.plot(time, comparison.measured[:, k], color=blue, label="measured")
        run.plot(time, comparison.predicted[:, k], color=orange, linestyle=(0, (4, 2)), label=label)
        run.set_ylabel(f"{CHANNEL_LABELS[name]} [m]")
        grey = STAND_IN["muted"]
        difference.fill_between(time, -band[:, k], band[:, k], color=grey, alpha=0.25, linewidth=0)
        shown = MILLIMETRES * comparison.difference[:, k]
        difference.plot(time, shown, color=blue, label=f"measured minus {label}")
        if tolerance is not None and np.nanmax(np.abs([shown, band[:, k]])) > 0.3 * MILLIMETRES * tolerance:
            for sign in (-1.0, 1.0):
                difference.axhline(sign * MILLIMETRES * tolerance, color=STAND_IN["limit"], linewidth=0.8)
        difference.set_ylabel("difference [mm]")
        for axes in (run, difference):
            axes.margins(x=0.0, y=0.15)
    for axes in grid[-1]:
        axes.set_xlabel(TIME)
    figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _intervals_figure(result: Identification) -> Drawing:
    """Draw the interval of each number over its value, those from the spread between runs darker."""
    known = [estimate for estimate in result.estimates if estimate.value != 0.0]
    figure, axes = canvas(WIDTH, 0.7 + 0.24 * len(known))
    for row, estimate in enumerate(known):
        percent = 100.0 / abs(estimate.value)
        for half, opacity, width in ((estimate.half_width, 0.35, 5.0), (estimate.spread, 1.0, 2.0)):
            ends, style = [-percent * half, percent * half], {"alpha": opacity, "linewidth": width}
            axes.plot(ends, [row, row], color=STAND_IN[SERIES[0]], solid_capstyle="butt", **style)
    labels = [estimate.name.removeprefix("effects.") for estimate in known]
    axes.set_yticks(range(len(known)), labels)
    axes.invert_yaxis()
    axes.set_xscale("symlog", linthresh=0.1)
    axes.set_xlabel("deviation from the value [%]")
    make_room(figure, labels)
    return figure
