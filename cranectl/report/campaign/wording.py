"""What a campaign's page calls metrics and parameters, and what its parts say of the figures of the runs."""

import shlex
from collections.abc import Sequence

import numpy as np

from cranectl.campaign.definition import Campaign
from cranectl.campaign.evaluation import Analysis, GroupAnalysis, Pair
from cranectl.campaign.manifest import controller_from, resume_command
from cranectl.campaign.results import RESUME, Results
from cranectl.campaign.sensitivity import Correlations
from cranectl.campaign.summary import CONFIDENCE, EFFORT, MAIN_METRICS, MEASURE, software_notes
from cranectl.campaign.table import describe
from cranectl.metrics import all_metrics, low_is_bad

NAMED_PARAMETERS = 3  # parameters in a sentence
COLUMN = MAIN_METRICS.index(MEASURE)
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


def number(value: float | None, digits: int = 3, form: str = "") -> str:
    """Return a number for a table, to so many digits or in `form`; a dash where there is none."""
    return "–" if value is None or value != value else format(value, form or f".{digits}g")


def percent(share: float | None) -> str:
    """Return a share in percent; a dash where there is none."""
    return number(share and 100.0 * share, form=".1f")


def probability(p: float) -> str:
    """Of a test."""
    return "–" if p != p else "< 0.001" if p < 1e-3 else f"{p:.3f}"


def replay_command(results: Results, sample: int, controller: str, plant: str = "") -> str:
    """Return the command that runs a sample again; on all plants where none is named."""
    named = controller_from(results.manifest, results.directory, controller)
    asked = ["--run", str(sample), "--controller", named, *(["--plant", plant] if plant else [])]
    return shlex.join(["cranectl", "campaign", "replay", str(results.directory), *asked])


def about(analysis: Analysis) -> str:
    """What was run."""
    results = analysis.results
    settings = results.campaign.settings
    many = results.campaign.runs
    return (
        f"{many} samples, each run with {_list(settings.controllers)} on {_list(settings.plants)}, "
        f"{settings.drive} drives, scenario {settings.scenario}. "
        f"Sampling: {settings.sampling}, seed {settings.seed}. {len(results)} runs are in the result."
    )


def incomplete(analysis: Analysis) -> str:
    """What is missing and how to get it; empty for a whole result."""
    results = analysis.results
    if not results.missing:
        return ""
    return (
        f"INCOMPLETE: {results.missing_runs} of {results.campaign.all_runs} runs are missing, and "
        f"everything here is of the others. Complete it with {resume_command(results.manifest) or RESUME}."
    )


def software(analysis: Analysis) -> tuple[str, ...]:
    """What made the runs, where that is not what is installed."""
    return tuple(f"{note[0].upper()}{note[1:]}." for note in software_notes(analysis.results))


def what_fails(analysis: Analysis) -> str:
    """When a run counts as failed."""
    limits = analysis.results.campaign.settings.limits.given
    beyond = "; ".join(
        f"{metric} {'below' if low_is_bad(metric) else 'above'} {limit:g}" for metric, limit in limits.items()
    )
    return f"A run fails if it stops before its end{f', or with {beyond}' if beyond else ''}."


def distributions_sentence(parts: Sequence[GroupAnalysis]) -> str:
    """Tell the medians of the controllers."""
    medians = ((part.summary.median_max_error_m, part.group.controller) for part in parts)
    texts = ", ".join(f"{number(value)} m ({name})" for value, name in medians if value is not None)
    if not texts:
        return "No run completed."
    sentence = "A curve that ends below 1 leaves out runs that stopped or never settled."
    return f"Largest error, median: {texts}. {sentence}"


def correlations_sentence(found: Correlations) -> str:
    """What goes with the largest error."""
    runs, floor = int(found.runs[COLUMN]), float(found.floors[COLUMN])
    strength = found.strength[:, COLUMN]
    order = [int(k) for k in np.argsort(-strength, kind="stable") if strength[k] > 0.0]
    if floor >= 1.0:
        return f"{runs} completed runs are too few to tell influence from chance."
    beyond = (
        f"With {runs} runs, chance alone reaches |ρ| = {floor:.2f} somewhere in "
        f"{100 - 100 * CONFIDENCE:.0f} % of such figures"
    )
    if not order:
        return f"Nothing goes with the largest error beyond chance. {beyond}."
    named = ", ".join(_strength(found, k) for k in order[:NAMED_PARAMETERS])
    return f"With the largest error go {named}. {beyond}."


def sobol_sentence(parts: Sequence[GroupAnalysis], parameters: Sequence[str]) -> str:
    """What matters, for each controller."""
    texts = []
    for part in parts:
        found = part.sobol[MEASURE]
        order = [int(k) for k in np.argsort(-found.total, kind="stable") if found.important[k]]
        named = ", ".join(f"{parameters[k]} ({found.total[k]:.2f})" for k in order[:NAMED_PARAMETERS])
        left = f"; {found.left_out} base points left out" if found.left_out else ""
        texts.append(
            f"{part.group.controller}: {named or 'nothing is surely above 0.05'}, from "
            f"{found.base_points} base points{left}"
        )
    return f"Total indices of {metric_name(MEASURE)}. {'. '.join(texts)}."


def tornado_sentence(part: GroupAnalysis) -> str:
    """Tell which parameter has the widest bar."""
    nominal = float(part.group.metrics[MEASURE][0])
    effects = [(abs(float(s.metrics[COLUMN]) - nominal), s) for s in part.one_at_a_time]
    known = [(size, s) for size, s in effects if not np.isnan(size)]
    if not known:
        return f"{part.group.controller}: no run completed to compare."
    size, widest = max(known, key=lambda pair: pair[0])
    stopped = len(effects) - len(known)
    left = f"; {stopped} run{'s' * (stopped > 1)} did not complete" if stopped else ""
    most = f"{widest.parameter} = {widest.value:.3g} changes it most, by {size:.2g} m"
    return f"{part.group.controller}: {most}{left}."


def failures_sentence(parts: Sequence[GroupAnalysis]) -> str:
    """Tell which parameters separate failed runs from the others."""
    texts = []
    for part in parts:
        found = [each for each in part.separations if each.significant][:NAMED_PARAMETERS]
        named = ", ".join(f"{each.parameter} (distance {each.distance:.2f})" for each in found)
        texts.append(f"{part.group.controller}: {named or 'no parameter beyond chance'}.")
    return f"What separates failed from other runs. {' '.join(texts)}"


def agreement_sentence(pairs: Sequence[Pair]) -> str:
    """How far the plants are apart."""
    texts = [
        f"{pair.first.controller}: half of the samples within {number(pair.agreement.quantiles[1], 2)} m, "
        f"95 % within {number(pair.agreement.quantiles[2], 2)} m"
        for pair in pairs
        if pair.agreement.samples
    ]
    return f"{'. '.join(texts)}." if texts else "No sample completed on both of the plants compared."


def _strength(found: Correlations, k: int) -> str:
    name = found.parameters[k]
    if found.bent[k, COLUMN]:
        return f"{name} (neither rising nor falling, η = {found.eta[k, COLUMN]:.2f})"
    return f"{name} (ρ = {found.rho[k, COLUMN]:+.2f})"


def _list(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
