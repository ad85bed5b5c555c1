"""The result of a campaign as one page: outcome, worst runs, comparisons, what decides, what was run."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cranectl.campaign.evaluation import Analysis, GroupAnalysis
from cranectl.campaign.sensitivity import MIN_BASE_POINTS
from cranectl.campaign.summary import MAIN_METRICS, MEASURE, compared_parameters
from cranectl.report.campaign import figures, tables, wording
from cranectl.report.campaign.wording import metric_name
from cranectl.report.page import Figure, Page, Section
from cranectl.report.table import Table, cells
from cranectl.support.arrays import Array

SHOWN_PANELS = 4  # parameters that have a panel of their own
FAINT = 1e-6  # stands for what may be chance


def campaign_page(analysis: Analysis, remade_by: str) -> Page:
    """The page."""
    settings = analysis.results.campaign.settings
    sections = [
        _outcome(analysis),
        Section("worst", "Runs worth a look", tables=(tables.worst_table(analysis),)),
        *_controllers(analysis),
        *_plants(analysis),
        *_influence(analysis),
        *_failures(analysis),
        _uncertainty(analysis),
    ]
    return Page(f"Campaign {settings.name}", settings.title, tuple(sections), remade_by)


def _outcome(analysis: Analysis) -> Section:
    limits = analysis.results.campaign.settings.limits.given
    summaries, quantiles, curves = [], [], []
    for parts in analysis.by_plant:
        plant, groups = parts[0].group.plant, [part.group for part in parts]
        table = tables.summary_table([part.summary for part in parts], f"On {plant}")
        failures = "; ".join(tables.failure_notes([part.summary for part in parts]))
        summaries.append(replace(table, note=" ".join(filter(None, (table.note, failures)))))
        quantiles.append(tables.metrics_quantiles(parts))
        title, verdict = f"distributions of the metrics on {plant}", wording.distributions_sentence(parts)
        curves.append(Figure.drawn(title, verdict, figures.distributions, groups, limits, alone=True))
    texts = [wording.incomplete(analysis), *wording.software(analysis)]
    texts += [wording.about(analysis), wording.what_fails(analysis)]
    return Section("outcome", "Outcome", tuple(filter(None, texts)), (*summaries, *quantiles), tuple(curves))


def _controllers(analysis: Analysis) -> Iterator[Section]:
    if not analysis.controllers:
        return
    sampling = analysis.results.campaign.settings.sampling
    compared, scatters = [], []
    for parts in analysis.by_plant:
        plant = parts[0].group.plant
        pairs = [pair for pair in analysis.controllers if pair.first.plant == plant]
        title = f"Samples that fail with one controller and not with the other, on {plant}"
        compared.append(tables.failures_table(pairs, sampling, title))
        compared.append(tables.controller_differences(pairs, sampling))
        title, groups = f"error against effort on {plant}", [part.group for part in parts]
        verdict = "Each cross spans 90 % of a controller's completed runs and meets at its medians."
        scatters.append(Figure.drawn(title, verdict, figures.effort_and_error, groups))
    yield Section("controllers", "Controllers", tables=tuple(compared), figures=tuple(scatters))


def _plants(analysis: Analysis) -> Iterator[Section]:
    sampling = analysis.results.campaign.settings.sampling
    compared = dict.fromkeys((pair.first.plant, pair.second.plant) for pair in analysis.plants)
    for k, (one, other) in enumerate(compared):
        pairs = [pair for pair in analysis.plants if (pair.first.plant, pair.second.plant) == (one, other)]
        title = f"largest error on {one} and on {other}, the same samples"
        figure = Figure.drawn(title, wording.agreement_sentence(pairs), figures.two_plants, pairs, alone=True)
        failing = "Samples that fail on one plant and not on the other"
        shown = [tables.plants_agreement(pairs), tables.failures_table(pairs, sampling, failing)]
        if any(pair.agreement.largest for pair in pairs):
            shown.append(tables.disagreements(analysis, pairs))
        anchor, heading = f"plants-{k}" if k else "plants", f"{one.capitalize()} and {other}"
        yield Section(anchor, heading, tables=tuple(shown), figures=(figure,))


def _influence(analysis: Analysis) -> Iterator[Section]:
    campaign = analysis.results.campaign
    names = [campaign.names[k] for k in campaign.varied]
    plants = analysis.by_plant
    if analysis.groups[0].one_at_a_time:
        steps = tuple(map(tables.one_at_a_time_table, analysis.groups))
        drawings = tuple(_tornado(parts, names) for parts in plants)
        yield Section("influence", "What decides", (_STEPS,), steps, drawings)
        return
    indices = [tables.sobol_table(parts, names) for parts in plants if any(part.sobol for part in parts)]
    shown = [figure for parts in plants for figure in _sobol(parts, names)]
    if compared_parameters(analysis.results):
        shown += [figure for parts in plants for figure in _correlations(parts)]
        shown += [_bands(analysis, parts) for parts in plants]
    if shown:
        few = campaign.settings.sampling == "saltelli" and not indices
        texts = (_SPREAD, _FEW) if few else (_SPREAD,)
        yield Section("influence", "What decides", texts, tuple(indices), tuple(shown))


_SPREAD = (
    "Influence is measured over completed runs. Colour marks what is beyond chance, corrected for the number "
    "of fields; parameters that were sampled with a correlation share their influence."
)
_FEW = (
    f"Sobol indices take {MIN_BASE_POINTS} base points all of whose runs completed, "
    "and an output that varies."
)
_STEPS = "Each parameter by itself is put at a low and at a high value, the others stay nominal."


def _correlations(parts: Sequence[GroupAnalysis]) -> Iterator[Figure]:
    order = np.argsort(-_strengths(parts).max(axis=1), kind="stable").tolist()
    for part in parts:
        if part.correlations is not None:
            title = f"what goes with what, {part.group.name}"
            verdict = wording.correlations_sentence(part.correlations)
            yield Figure.drawn(title, verdict, figures.correlation_fields, part.correlations, order)


def _bands(analysis: Analysis, parts: Sequence[GroupAnalysis]) -> Figure:
    strengths = _strengths(parts)[:, MAIN_METRICS.index(MEASURE)]
    leading = _leading(strengths, int((strengths > FAINT).sum()))
    columns = [compared_parameters(analysis.results)[j] for j in leading]
    title = f"largest error over what goes with it most, {parts[0].group.plant}"
    verdict = "Median and 5 to 95 % of completed runs, in ranges of equal number."
    return Figure.drawn(title, verdict, figures.error_bands, analysis, parts, columns)


def _leading(values: Sequence[float] | Array, beyond_chance: int) -> list[int]:
    """Places of the largest, those `beyond_chance` if there are two at least, and no more than SHOWN."""
    order: list[int] = np.argsort(-np.asarray(values), kind="stable").tolist()
    return order[: min(SHOWN_PANELS, max(2, beyond_chance))]


def _strengths(parts: Sequence[GroupAnalysis]) -> Array:
    """Return the strongest of all controllers (parameters, metrics); what may be chance below FAINT."""
    found = [part.correlations for part in parts if part.correlations is not None]
    strengths = [each.strength + FAINT * np.abs(np.nan_to_num(each.rho)) for each in found]
    strongest: Array = np.max(strengths, axis=0)
    return strongest


def _tornado(parts: Sequence[GroupAnalysis], names: Sequence[str]) -> Figure:
    widths = dict.fromkeys(names, 0.0)
    for part in parts:
        for effect in part.one_at_a_time:
            change = effect.metrics[MAIN_METRICS.index(MEASURE)] - part.group.metrics[MEASURE][0]
            widths[effect.parameter] = max(widths[effect.parameter], float(np.nan_to_num(abs(change))))
    order = sorted(names, key=lambda name: -widths[name])
    title = f"one parameter at a time on {parts[0].group.plant}"
    verdict = " ".join(map(wording.tornado_sentence, parts))
    return Figure.drawn(title, verdict, figures.tornado, parts, order, alone=True)


def _sobol(parts: Sequence[GroupAnalysis], names: Sequence[str]) -> Iterator[Figure]:
    having = [part for part in parts if MEASURE in part.sobol]
    if having:
        title = f"Sobol indices of the {metric_name(MEASURE)}, {parts[0].group.plant}"
        yield Figure.drawn(title, wording.sobol_sentence(having, names), figures.sobol_bars, having, names)


def _failures(analysis: Analysis) -> Iterator[Section]:
    rates, separating = [], []
    for parts in analysis.by_plant:
        having = [part for part in parts if part.separations]
        if not having:
            continue
        found = [each for part in having for each in part.separations]
        names = list(dict.fromkeys(each.parameter for each in found))
        distances = [max(each.distance for each in found if each.parameter == name) for name in names]
        beyond = len({each.parameter for each in found if each.significant})
        columns = [analysis.results.campaign.names.index(names[j]) for j in _leading(distances, beyond)]
        title = f"failure rate over what separates most, {parts[0].group.plant}"
        verdict = wording.failures_sentence(having)
        rates.append(Figure.drawn(title, verdict, figures.failure_rates, analysis, parts, columns))
        separating.append(tables.separation_table(having))
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
    made = Table("What was run, with what", ("", ""), tuple(cells(*fact) for fact in facts.items()), labels=2)
    return Section("uncertainty", "What is uncertain", tables=(tables.uncertainty_table(analysis), made))
