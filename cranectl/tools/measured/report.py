"""Tables, figures and pages of measured cranes: identified numbers, and verdicts on new runs."""

from collections.abc import Callable, Sequence

import numpy as np

from cranectl.report import Cell, Fact, Figure, FirstScreen, Page, Section, Table
from cranectl.support import Quantity
from cranectl.tools.measured.experiment import MODEL
from cranectl.tools.measured.identification import AT_BOUND, MAX_MISFIT, Estimate, Identification
from cranectl.tools.measured.replay import REPEATED
from cranectl.tools.measured.report_figures import MILLIMETRES, MeasuredFigures
from cranectl.tools.measured.uncertainty import BAND_DEVIATIONS, START
from cranectl.tools.measured.unknowns import ANGLE_DELAY, ANGLE_SCALE, AXES
from cranectl.tools.measured.verdict import (
    COVERED,
    FALSE_ALARMS,
    NOT_COVERED,
    NOT_DECIDED,
    WITHIN_TOLERANCE,
    RunVerdict,
)

MARKS = {COVERED: "good", WITHIN_TOLERANCE: "open", NOT_DECIDED: "open", NOT_COVERED: "bad"}  # worst last
MILLIRADIANS = 1e3
MIN_MISFIT = 0.25  # below which the stated noise hides errors
INTERVALS_CAPTION = (
    "The 95 % interval of each number, as a share of its value. Dark: the standard deviation between runs. "
    "Pale: the whole interval, with the errors that all runs share."
)
RESIDUALS_CAPTION = (
    "Left: measured and fitted. Right: measured minus fitted, and the band of what encoders add."
)


class IdentificationReport:
    """The numbers that were identified, as tables, remarks and a page."""

    @staticmethod
    def estimates(estimates: Sequence[Estimate], title: str, note: str = "") -> Table:
        """Return numbers of the crane with their intervals, and what the intervals come from."""
        columns: dict[str, Callable[[Estimate], Cell | str]] = {
            "number": lambda e: e.name.removeprefix("effects."),
            "unit": lambda e: e.unit,
            "value": lambda e: f"{e.value:.5g}",
            "± (95 %)": lambda e: AT_BOUND if e.at_bound else f"{e.half_width:.2g}",
            "spread of runs": lambda e: f"{e.spread:.2g}",
            "encoders": lambda e: f"{e.encoders:.2g}",
        }
        return Table.of(title, estimates, columns, labels=2, note=note)

    @staticmethod
    def table(result: Identification) -> Table:
        """Return the fitted numbers, and how well the model repeats the runs."""
        repeated = "motion" if result.replay == "motion" else "commands"
        title = f"Identified from the {repeated} of {result.runs} runs"
        return IdentificationReport.estimates(result.estimates, title, _misfit_note(result))

    @staticmethod
    def remarks(result: Identification, names: Sequence[str] = ()) -> list[str]:
        """Return in words what the runs of these names leave open, and whether the model fits them."""
        sentences = []
        if result.replay == "lines":
            sentences.append(
                "set-points change between rows: they are taken for straight lines (--replay lines)"
            )
        if result.unidentifiable:
            sentences.append(f"not identifiable from these logs: {', '.join(result.unidentifiable)}")
        sentences += [
            f"{e.name} is {AT_BOUND}, {e.value:.4g} {e.unit}: the fit would go beyond it, so it is no result"
            for e in result.estimates
            if e.at_bound
        ]
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
        if has_misfit(result):
            sentences.append(_misfit_sentence(result, names))
        elif (lasting := max(c.misfit for c in result.comparisons)) > MAX_MISFIT:
            sentences.append(
                f"residuals last: their means over a twentieth of a swing are up to {lasting:.3g} times the "
                "squared noise of such means. If readings drift, as of a camera, intervals are too narrow"
            )
        for name, misfit in result.misfits.items():
            if 0.0 < misfit < MIN_MISFIT:
                sentences.append(
                    f"the noise of {name} is overstated: its residuals are {misfit:.2g} times the squared "
                    "noise "
                    "of the rig. State less in effects.sensing, or errors hide in it"
                )
        if not result.converged:
            sentences.append(_failure(result, names))
        return sentences

    @staticmethod
    def page(result: Identification, names: Sequence[str], remade_by: str) -> Page:
        """Return the page of an identification from the logs of these names."""
        badge, reason = _fit_badge(result)
        largest = max(_largest_residuals(result))
        worst = max(result.misfits, key=lambda name: result.misfits[name])
        facts = (
            Fact("Runs", str(result.runs), f"{REPEATED[result.replay]} on the plant {MODEL}"),
            Fact("Numbers", str(len(result.estimates)), f"{len(result.unidentifiable)} more are left open"),
            Fact("Largest difference", Quantity(largest, "m").text(), "between measured and fitted load"),
            Fact("Misfit", f"{result.misfit:.3g}", f"of {worst}; 1 for noise alone"),
        )
        texts = tuple(
            f"{remark[0].upper()}{remark[1:]}." for remark in IdentificationReport.remarks(result, names)
        )
        intervals = Figure.drawn(
            "Intervals", INTERVALS_CAPTION, MeasuredFigures.intervals, result, alone=True
        )
        numbers = Section("numbers", "Numbers", texts, (IdentificationReport.table(result),), (intervals,))
        residuals = [
            Figure.drawn(
                name, RESIDUALS_CAPTION, MeasuredFigures.comparison, comparison, "fitted", alone=True
            )
            for name, comparison in zip(names, result.comparisons, strict=True)
        ]
        sections = (numbers, Section("residuals", "Residuals", figures=tuple(residuals)))
        lead = f"Fitted to {', '.join(names)}. Intervals: spread between runs, noise and steps of encoders."
        return Page("Identified crane", lead, sections, remade_by, FirstScreen(badge, reason, facts))


def _misfit_note(result: Identification) -> str:
    """Return the largest distance at the load, and the misfit of each channel."""
    largest = Quantity(max(_largest_residuals(result)), "m").text()
    misfits = ", ".join(f"{name} {misfit:.2g}" for name, misfit in result.misfits.items())
    return f"Largest difference at the load: {largest}. Misfit (1 for noise alone): {misfits}"


def _largest_residuals(result: Identification) -> list[float]:
    """Return the largest distance between measured and fitted load of each run [m]."""
    return [float(load.distance[load.largest]) for load in result.loads]


def has_misfit(result: Identification) -> bool:
    """Return True if the model misses readings by more than their noise."""
    return result.misfit > MAX_MISFIT


def _misfit_sentence(result: Identification, names: Sequence[str]) -> str:
    """Return by how much the model misses the readings, where and when."""
    largest = _largest_residuals(result)
    run = int(np.argmax(largest))
    load = result.loads[run]
    channel = max(result.misfits, key=lambda name: result.misfits[name])
    name = names[run] if names else f"run {run + 1}"
    return (
        f"MISFIT: up to {Quantity(largest[run], 'm')} at the load, in {name} at "
        f"{load.time[load.largest]:.2f} s. "
        f"The crane does something that the model does not: residuals of {channel} are "
        f"{result.misfits[channel]:.3g} times the squared noise of its readings. "
        "`cranectl validate` tells whether the model is good enough"
    )


def _failure(result: Identification, names: Sequence[str]) -> str:
    """Return why the fit failed, and what to state instead."""
    ended = next((k for k, load in enumerate(result.loads) if not np.isfinite(load.distance).all()), None)
    if ended is None:
        return "NOT CONVERGED: the optimiser did not finish, so the numbers mean little"
    name = names[ended] if names else f"run {ended + 1}"
    at = result.loads[ended].time[int(np.argmax(~np.isfinite(result.loads[ended].distance)))]
    return (
        f"NOT CONVERGED: the prediction of {name} ends at {at:.2f} s, so the numbers mean little. "
        "State masses, time constants and effects.friction of the rig nearer to those of the crane"
    )


def _fit_badge(result: Identification) -> tuple[Cell, str]:
    """Return in a word and in a sentence how well the model repeats the runs."""
    if not result.converged:
        return Cell("NOT CONVERGED", "bad"), "The fit failed, so the numbers mean little."
    if has_misfit(result):
        return Cell("MISFIT", "open"), "The model misses readings by more than their noise."
    return Cell("fitted", "good"), "The residuals are as large as the stated noise of the readings."


class VerdictReport:
    """Verdicts on measured runs, as a table, sentences and a page."""

    @staticmethod
    def table(verdicts: Sequence[RunVerdict]) -> Table:
        """Return the answers, the largest difference of each load, and where a run differs most clearly."""
        columns: dict[str, Callable[[RunVerdict], Cell | str]] = {
            "log": lambda v: v.name,
            "answer": lambda v: Cell(v.answer, MARKS[v.answer]),
            "largest [mm]": lambda v: f"{MILLIMETRES * v.largest:.2f}",
            "at [s]": lambda v: f"{v.largest_at:.2f}",
            "band ± [mm]": lambda v: f"{MILLIMETRES * v.band:.2f}",
            "noise [mm]": lambda v: f"{MILLIMETRES * v.load.noise:.2f}",
            "clearest in": lambda v: v.channel,
            "times its σ": lambda v: f"{v.statistic:.1f}",
            "p": lambda v: f"{v.probability:.3f}",
        }
        note = "Largest, band and noise are of the load's position, at single samples"
        return Table.of(
            "Measured minus predicted, runs that were not used", verdicts, columns, labels=2, note=note
        )

    @staticmethod
    def sentence(verdicts: Sequence[RunVerdict]) -> str:
        """Return what was shown, and how often the verdict errs."""
        covered, runs = sum(verdict.answer == COVERED for verdict in verdicts), len(verdicts)
        rate = f"{100 * FALSE_ALARMS:g} %"
        errs = f"A model without error is called not covered in at most {rate} of such verdicts."
        if covered < runs:
            return f"{covered} of {runs} runs are covered. {errs}"
        share = FALSE_ALARMS ** (1.0 / runs)
        return f"All runs are covered: so are at least {100 * share:.0f} % of such motions, at 95 %. {errs}"

    @staticmethod
    def explanation(verdict: RunVerdict, tolerance: float | None) -> str:
        """Return in a sentence why a run has its answer: where and when it differs, and by how much."""
        largest, at = Quantity(verdict.largest, "m").text(), f"{verdict.largest_at:.2f} s"
        if verdict.answer == NOT_DECIDED:
            return f"{verdict.answer}: {verdict.reason}{_shrinking_advice(verdict)}"
        if not np.isfinite(verdict.largest):
            ended = float(verdict.load.time[int(np.argmax(~np.isfinite(verdict.load.distance)))])
            return f"{verdict.answer}: the prediction ended at {ended:.2f} s, where its load left the model"
        where = f"the load is at most {largest} off, at {at}"
        if verdict.answer == COVERED:
            return f"{verdict.answer}: {where}, and numbers, start and noise explain it"
        left = f"{verdict.channel} differs most clearly, {verdict.statistic:.1f} standard deviations"
        if verdict.left_at is not None:
            left += f"; the first difference beyond the model is at {verdict.left_at:.2f} s"
        sentence = f"{verdict.answer}: {where}; {left}"
        if verdict.answer == NOT_COVERED and tolerance is None:
            sentence += f". A tolerance of {_rounded_up(verdict.met_tolerance)} would be met"
        return sentence

    @staticmethod
    def asides(verdict: RunVerdict) -> list[str]:
        """Return what else to know of a judged run: a load that swings at the start, untested channels."""
        sentences = []
        if verdict.swing:
            sentences.append(f"its load swings by {MILLIRADIANS * verdict.swing:.2g} mrad at the start")
        untested = [name for name in verdict.comparison.channels if name not in verdict.tested]
        if untested and verdict.tested:
            sentences.append(f"it does not test {', '.join(untested)}, which hardly move")
        return sentences

    @staticmethod
    def page(verdicts: Sequence[RunVerdict], tolerance: float | None, remade_by: str) -> Page:
        """Return the page of verdicts on measured runs, with `tolerance` [m] if one is accepted."""
        worst = max(verdicts, key=lambda verdict: [*MARKS].index(verdict.answer))
        farthest = max(verdicts, key=lambda verdict: verdict.largest)
        covered = sum(verdict.answer == COVERED for verdict in verdicts)
        accepted = "none stated" if tolerance is None else f"accepted: {Quantity(tolerance, 'm')}"
        probability = f"{100.0 * min(v.probability for v in verdicts):.2g} %"
        facts = (
            Fact("Runs covered", f"{covered} of {len(verdicts)}"),
            Fact("Largest difference", Quantity(farthest.largest, "m").text(), accepted),
            Fact("Widest band", f"± {Quantity(max(v.band for v in verdicts), 'm')}", "of the predictions"),
            Fact("Smallest probability", probability, "that a model without error differs as much"),
        )
        caption = (
            f"Left: measured and predicted. Right: measured minus predicted, and ± {BAND_DEVIATIONS:g} "
            "standard "
            "deviations that the identified crane leaves open, as means over a twentieth of a swing."
        )
        sections = [Section("answers", "Answers", tables=(VerdictReport.table(verdicts),))]
        for number, verdict in enumerate(verdicts, 1):
            data = verdict.comparison, "predicted", tolerance
            drawn = Figure.drawn(verdict.name, caption, MeasuredFigures.comparison, *data, alone=True)
            texts = (VerdictReport.explanation(verdict, tolerance), *VerdictReport.asides(verdict))
            why = tuple(f"{text[0].upper()}{text[1:]}." for text in texts)
            title = f"{verdict.answer}: {verdict.name}"
            sections.append(Section(f"run-{number}", title, why, figures=(drawn,)))
        first = FirstScreen(Cell(worst.answer, MARKS[worst.answer]), VerdictReport.sentence(verdicts), facts)
        lead = "Nothing was fitted to these runs. Each was predicted from where the crane rested."
        return Page("Does the model cover the crane?", lead, tuple(sections), remade_by, first)


def _rounded_up(size: float) -> str:
    """Return a size [m] as a tolerance that the command line takes and that is not smaller."""
    return f"{np.ceil(10.0 * MILLIMETRES * size) / 10.0:.1f}mm"


def _shrinking_advice(verdict: RunVerdict) -> str:
    """Return which runs would narrow the band, where it is too wide."""
    if "band" not in verdict.reason:
        return ""
    if verdict.widest_by == START:
        return ". The start adds most to the band: let the load hang still longer before it moves"
    axis = next((axis for axis in AXES if axis in verdict.widest_by), "")
    if verdict.widest_by.rpartition(".")[2].isdigit():
        axis = AXES[int(verdict.widest_by.rpartition(".")[2])]
    runs = f"in which the {axis} starts and stops often" if axis else "in which the load swings more"
    return f". {verdict.widest_by} adds most to the band: identify with further runs {runs}"
