"""The page of a campaign: outcome, worst runs, comparisons, influence of parameters, what was run."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cranectl.campaign.evaluation import Analysis, GroupAnalysis, Pair
from cranectl.campaign.failures import FailureVerdict
from cranectl.campaign.manifest import Manifest
from cranectl.campaign.report.figures import CampaignFigures
from cranectl.campaign.report.first_screen import first_screen_of
from cranectl.campaign.report.metric_text import MetricText
from cranectl.campaign.report.tables import CampaignTables
from cranectl.campaign.results import RESUME, Results
from cranectl.campaign.sensitivity import MIN_BASE_POINTS, Correlations
from cranectl.campaign.summary import CONFIDENCE, MAIN_METRICS, MEASURE, compared_parameters, software_notes
from cranectl.metrics import Metric
from cranectl.report import Cell, Figure, Page, Section, Table
from cranectl.support import Array

SHOWN_PANELS = 4  # parameters that have a panel of their own
NAMED_PARAMETERS = 3  # parameters in a sentence
COLUMN = MAIN_METRICS.index(MEASURE)
FAINT = 1e-6  # strength of a correlation that may be chance


def campaign_page(analysis: Analysis, remade_by: str, verdicts: Sequence[FailureVerdict] = ()) -> Page:
    """Return the page of a campaign; `verdicts` are those on its failures, if they were judged."""
    settings = analysis.results.campaign.settings
    sections = [
        _outcome(analysis),
        Section("worst", "Runs worth a look", tables=(CampaignTables.worst(analysis),)),
        *_controllers(analysis),
        *_plants(analysis),
        *_influence(analysis),
        *_failures(analysis),
        _uncertainty(analysis),
    ]
    title, lead = (settings.title, settings.name) if settings.title else (settings.name, "")
    return Page(title, lead, tuple(sections), remade_by, first_screen_of(analysis, verdicts))


def _outcome(analysis: Analysis) -> Section:
    limits = analysis.results.campaign.settings.limits.given
    summaries, quantiles, curves = [], [], []
    for parts in analysis.by_plant:
        plant, groups = parts[0].group.plant, [part.group for part in parts]
        table = CampaignTables.summary([part.summary for part in parts], f"On {plant}")
        failures = "; ".join(CampaignTables.failure_notes([part.summary for part in parts]))
        summaries.append(replace(table, note=" ".join(filter(None, (table.note, failures)))))
        quantiles.append(CampaignTables.quantiles(parts))
        title, verdict = f"distributions of the metrics on {plant}", _distributions_sentence(parts)
        curves.append(Figure.drawn(title, verdict, CampaignFigures.distributions, groups, limits, alone=True))
    texts = tuple(_summary_of(analysis.results))
    return Section("outcome", "Outcome", texts, (*summaries, *quantiles), tuple(curves))


def _controllers(analysis: Analysis) -> Iterator[Section]:
    if not analysis.controllers:
        return
    sampling = analysis.results.campaign.settings.sampling
    compared, scatters = [], []
    for parts in analysis.by_plant:
        plant = parts[0].group.plant
        pairs = [pair for pair in analysis.controllers if pair.first.plant == plant]
        title = f"Samples that fail with one controller and not with the other, on {plant}"
        compared.append(CampaignTables.failures(pairs, sampling, title))
        compared.append(CampaignTables.controllers(pairs, sampling))
        title, groups = f"error against effort on {plant}", [part.group for part in parts]
        verdict = "Each cross spans 90 % of a controller's completed runs and meets at its medians."
        scatters.append(Figure.drawn(title, verdict, CampaignFigures.effort_and_error, groups))
    yield Section("controllers", "Controllers", tables=tuple(compared), figures=tuple(scatters))


def _plants(analysis: Analysis) -> Iterator[Section]:
    sampling = analysis.results.campaign.settings.sampling
    compared = dict.fromkeys((pair.first.plant, pair.second.plant) for pair in analysis.plants)
    for k, (one, other) in enumerate(compared):
        pairs = [pair for pair in analysis.plants if (pair.first.plant, pair.second.plant) == (one, other)]
        title = f"largest error on {one} and on {other}, the same samples"
        figure = Figure.drawn(
            title, _agreement_sentence(pairs), CampaignFigures.two_plants, pairs, alone=True
        )
        failing = "Samples that fail on one plant and not on the other"
        shown = [CampaignTables.plants(pairs), CampaignTables.failures(pairs, sampling, failing)]
        if any(pair.agreement.largest for pair in pairs):
            shown.append(CampaignTables.disagreements(analysis, pairs))
        anchor, heading = f"plants-{k}" if k else "plants", f"{one.capitalize()} and {other}"
        yield Section(anchor, heading, tables=tuple(shown), figures=(figure,))


def _influence(analysis: Analysis) -> Iterator[Section]:
    campaign = analysis.results.campaign
    names = [campaign.names[k] for k in campaign.varied]
    plants = analysis.by_plant
    if analysis.groups[0].one_at_a_time:
        steps = tuple(map(CampaignTables.one_at_a_time, analysis.groups))
        drawings = tuple(_tornado(parts, names) for parts in plants)
        yield Section("influence", "What decides", (_STEPS,), steps, drawings)
        return
    indices = [CampaignTables.sobol(parts, names) for parts in plants if any(part.sobol for part in parts)]
    shown = []
    for parts in plants:
        if having := [part for part in parts if MEASURE in part.sobol]:
            title = f"Sobol indices of the {MetricText.name(MEASURE)}, {parts[0].group.plant}"
            sentence = _sobol_sentence(having, names)
            shown.append(Figure.drawn(title, sentence, CampaignFigures.sobol, having, names))
    if compared_parameters(analysis.results):
        shown += [figure for parts in plants for figure in _correlations(parts)]
        shown += [_bands(analysis, parts) for parts in plants]
    if shown:
        is_short = campaign.settings.sampling == "saltelli" and not indices
        texts = (_SPREAD, _FEW) if is_short else (_SPREAD,)
        yield Section("influence", "What decides", texts, tuple(indices), tuple(shown))


_SPREAD = (
    "Influence is measured over completed runs. Colour marks fields beyond chance, corrected for the number "
    "of fields. Parameters that were sampled with a correlation share their influence."
)
_FEW = (
    f"Sobol indices need {MIN_BASE_POINTS} base points whose runs all completed, and an output that varies."
)
_STEPS = "Each parameter in turn takes a low and a high value, while the others stay nominal."


def _correlations(parts: Sequence[GroupAnalysis]) -> Iterator[Figure]:
    order = np.argsort(-_strengths(parts).max(axis=1), kind="stable").tolist()
    for part in parts:
        if part.correlations is not None:
            title = f"what goes with what, {part.group.name}"
            verdict = _correlations_sentence(part.correlations)
            yield Figure.drawn(title, verdict, CampaignFigures.correlations, part.correlations, order)


def _bands(analysis: Analysis, parts: Sequence[GroupAnalysis]) -> Figure:
    strengths = _strengths(parts)[:, COLUMN]
    leading = _leading(strengths, int((strengths > FAINT).sum()))
    columns = [compared_parameters(analysis.results)[j] for j in leading]
    title = f"largest error over what goes with it most, {parts[0].group.plant}"
    verdict = "Median and 5 to 95 % of completed runs, in ranges with equally many runs."
    return Figure.drawn(title, verdict, CampaignFigures.error_bands, analysis, parts, columns)


def _leading(values: Sequence[float] | Array, beyond_chance: int) -> list[int]:
    """Return the places of the largest values: at least two, those beyond chance, at most SHOWN_PANELS."""
    order: list[int] = np.argsort(-np.asarray(values), kind="stable").tolist()
    return order[: min(SHOWN_PANELS, max(2, beyond_chance))]


def _strengths(parts: Sequence[GroupAnalysis]) -> Array:
    """Return the strongest correlation over all controllers (parameters, metrics); chance is below FAINT."""
    correlations = [part.correlations for part in parts if part.correlations is not None]
    strengths = [entry.strength + FAINT * np.abs(np.nan_to_num(entry.rho)) for entry in correlations]
    strongest: Array = np.max(strengths, axis=0)
    return strongest


def _tornado(parts: Sequence[GroupAnalysis], names: Sequence[str]) -> Figure:
    widths = dict.fromkeys(names, 0.0)
    for part in parts:
        for effect in part.one_at_a_time:
            change = effect.metrics[COLUMN] - part.group.metrics[MEASURE][0]
            widths[effect.parameter] = max(widths[effect.parameter], float(np.nan_to_num(abs(change))))
    order = sorted(names, key=lambda name: -widths[name])
    title = f"one parameter at a time on {parts[0].group.plant}"
    verdict = " ".join(map(_tornado_sentence, parts))
    return Figure.drawn(title, verdict, CampaignFigures.tornado, parts, order, alone=True)


def _failures(analysis: Analysis) -> Iterator[Section]:
    rates, separating = [], []
    for parts in analysis.by_plant:
        having = [part for part in parts if part.separations]
        if not having:
            continue
        separations = [separation for part in having for separation in part.separations]
        names = list(dict.fromkeys(separation.parameter for separation in separations))
        distances = [
            max(separation.distance for separation in separations if separation.parameter == name)
            for name in names
        ]
        beyond = len({separation.parameter for separation in separations if separation.significant})
        columns = [analysis.results.campaign.names.index(names[j]) for j in _leading(distances, beyond)]
        title = f"failure rate over what separates most, {parts[0].group.plant}"
        verdict = _failures_sentence(having)
        rates.append(Figure.drawn(title, verdict, CampaignFigures.failure_rates, analysis, parts, columns))
        separating.append(CampaignTables.separation(having))
    if rates:
        yield Section("failures", "What fails", tables=tuple(separating), figures=tuple(rates))


def _uncertainty(analysis: Analysis) -> Section:
    settings = analysis.results.campaign.settings
    facts = {
        "scenario": settings.scenario,
        "settings of all runs": ", ".join(settings.set) or "none",
        "sampling": f"{settings.sampling}, seed {settings.seed}",
        "samples": str(analysis.results.campaign.runs),
        "runs": str(len(analysis.results)),
    }
    for k, (_, versions) in enumerate(analysis.results.origins, 1):
        named = f", software {k}" if k > 1 else ""
        facts |= {f"{name}{named}": str(version) for name, version in versions.items()}
    made = Table(
        "What was run, with what", ("", ""), tuple(Cell.row(*fact) for fact in facts.items()), labels=2
    )
    return Section("uncertainty", "What is uncertain", tables=(CampaignTables.uncertainty(analysis), made))


def _summary_of(results: Results) -> Iterator[str]:
    """Yield sentences on missing runs, other software, what was run, and when a run fails."""
    campaign = results.campaign
    settings, limits = campaign.settings, campaign.settings.limits.given.items()
    if results.missing:
        yield (
            f"INCOMPLETE: {results.missing_runs} of {campaign.all_runs} runs are missing; this page "
            "describes the others. Complete the result with "
            f"{Manifest.resume_command(results.manifest) or RESUME}."
        )
    yield from (f"{note[0].upper()}{note[1:]}." for note in software_notes(results))
    yield (
        f"{campaign.runs} samples, each run with {Cell.listed(settings.controllers)} on "
        f"{Cell.listed(settings.plants)}, {settings.drive} drives, scenario {settings.scenario}. "
        f"Sampling: {settings.sampling}, seed {settings.seed}. {len(results)} runs are in the result."
    )
    beyond = "; ".join(f"{m} {'below' if Metric.low_is_bad(m) else 'above'} {limit:g}" for m, limit in limits)
    yield f"A run fails if it stops before its end{f', or with {beyond}' if beyond else ''}."


def _distributions_sentence(parts: Sequence[GroupAnalysis]) -> str:
    medians = ((part.summary.median_max_error_m, part.group.controller) for part in parts)
    texts = ", ".join(
        f"{CampaignTables.number(value)} m ({name})" for value, name in medians if value is not None
    )
    sentence = "A curve ends below 1 where runs stopped or never settled."
    return f"Largest error, median: {texts}. {sentence}" if texts else "No run completed."


def _correlations_sentence(correlations: Correlations) -> str:
    runs, floor = int(correlations.runs[COLUMN]), float(correlations.floors[COLUMN])
    strength = correlations.strength[:, COLUMN]
    order = [int(k) for k in np.argsort(-strength, kind="stable") if strength[k] > 0.0]
    if floor >= 1.0:
        return f"{runs} completed runs are too few to tell influence from chance."
    beyond = (
        f"With {runs} runs, chance alone reaches |ρ| = {floor:.2f} somewhere in "
        f"{100 - 100 * CONFIDENCE:.0f} % of such figures"
    )
    if not order:
        return f"Nothing correlates with the largest error beyond chance. {beyond}."
    named = []
    for k in order[:NAMED_PARAMETERS]:
        how = f"ρ = {correlations.rho[k, COLUMN]:+.2f}"
        if correlations.bent[k, COLUMN]:
            how = f"neither rising nor falling, η = {correlations.eta[k, COLUMN]:.2f}"
        named.append(f"{correlations.parameters[k]} ({how})")
    return f"These correlate with the largest error: {', '.join(named)}. {beyond}."


def _sobol_sentence(parts: Sequence[GroupAnalysis], parameters: Sequence[str]) -> str:
    texts = []
    for part in parts:
        indices = part.sobol[MEASURE]
        order = [int(k) for k in np.argsort(-indices.total, kind="stable") if indices.important[k]]
        named = ", ".join(f"{parameters[k]} ({indices.total[k]:.2f})" for k in order[:NAMED_PARAMETERS])
        left = f"; {indices.left_out} base points left out" if indices.left_out else ""
        named = named or "nothing is surely above 0.05"
        texts.append(f"{part.group.controller}: {named}, from {indices.base_points} base points{left}")
    return f"Total indices of {MetricText.name(MEASURE)}. {'. '.join(texts)}."


def _tornado_sentence(part: GroupAnalysis) -> str:
    """Return a sentence on the parameter with the widest bar."""
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


def _failures_sentence(parts: Sequence[GroupAnalysis]) -> str:
    """Return sentences on the parameters that separate failed runs from the others."""
    texts = []
    for part in parts:
        beyond = [separation for separation in part.separations if separation.significant][:NAMED_PARAMETERS]
        named = ", ".join(
            f"{separation.parameter} (distance {separation.distance:.2f})" for separation in beyond
        )
        texts.append(f"{part.group.controller}: {named or 'no parameter beyond chance'}.")
    return f"Parameters that separate failed runs from the others. {' '.join(texts)}"


def _agreement_sentence(pairs: Sequence[Pair]) -> str:
    texts = [
        f"{pair.first.controller}: half of the samples within "
        f"{CampaignTables.number(pair.agreement.quantiles[1], 2)} m, "
        f"95 % within {CampaignTables.number(pair.agreement.quantiles[2], 2)} m"
        for pair in pairs
        if pair.agreement.samples
    ]
    return f"{'. '.join(texts)}." if texts else "No sample completed on both plants."
