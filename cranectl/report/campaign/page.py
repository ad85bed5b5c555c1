"""The result of a campaign as one page: outcome, worst runs, comparisons, what decides, what was run."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.evaluation import Analysis, GroupAnalysis, Pair
from cranectl.campaign.groups import MAIN_METRICS, compared_parameters
from cranectl.campaign.sensitivity import LEAST
from cranectl.campaign.summary import MEASURE
from cranectl.report.campaign import wording
from cranectl.report.campaign.figures import distributions_svg, effort_svg, plants_svg
from cranectl.report.campaign.influence_figures import (
    bands_svg,
    correlations_svg,
    failure_rates_svg,
    sobol_svg,
    tornado_svg,
)
from cranectl.report.campaign.labels import metric_name
from cranectl.report.campaign.pair_tables import (
    controller_differences,
    disagreements,
    failures_by_controller,
    failures_by_plant,
    plants_agreement,
)
from cranectl.report.campaign.tables import (
    metrics_quantiles,
    separation_table,
    sobol_table,
    swings_table,
    uncertainty_table,
    worst_table,
)
from cranectl.report.page import Figure, Page, Section
from cranectl.report.table import Cell, Table

SHOWN = 4  # parameters that have a panel of their own
FAINT = 1e-6  # stands for what may be chance
Array = NDArray[np.float64]
Numbers = Iterator[int]  # of figures


def campaign_page(analysis: Analysis, outcome: Sequence[Table], remade_by: str) -> Page:
    """The page; `outcome` are the tables of the summary, as the terminal has them."""
    settings = analysis.results.campaign.settings
    numbers = count(1)
    sections = [
        _outcome(analysis, outcome, numbers),
        Section("worst", "Runs worth a look", tables=(worst_table(analysis),)),
        *_controllers(analysis, numbers),
        *_plants(analysis, numbers),
        *_influence(analysis, numbers),
        *_failures(analysis, numbers),
        _uncertainty(analysis),
    ]
    return Page(f"Campaign {settings.name}", settings.title, tuple(sections), remade_by)


def by_plant(analysis: Analysis) -> list[list[GroupAnalysis]]:
    """The groups of each plant."""
    plants = analysis.results.campaign.settings.plants
    return [[part for part in analysis.groups if part.group.plant == plant] for plant in plants]


def _outcome(analysis: Analysis, outcome: Sequence[Table], numbers: Numbers) -> Section:
    limits = analysis.results.campaign.settings.limits.given
    figures = []
    for parts in by_plant(analysis):
        groups, k = [part.group for part in parts], next(numbers)
        title = f"distributions of the metrics on {groups[0].plant}"
        svg = distributions_svg(groups, limits, f"f{k}")
        figures.append(Figure(str(k), title, svg, wording.distributions_sentence(parts), alone=True))
    texts = (
        wording.incomplete(analysis),
        *wording.software(analysis),
        wording.about(analysis),
        wording.what_fails(analysis),
    )
    tables = (*map(_on_one_line, outcome), *map(metrics_quantiles, by_plant(analysis)))
    return Section("outcome", "Outcome", tuple(filter(None, texts)), tables, tuple(figures))


def _controllers(analysis: Analysis, numbers: Numbers) -> Iterator[Section]:
    if not analysis.controllers:
        return
    sampling = analysis.results.campaign.settings.sampling
    tables, figures = [], []
    for parts in by_plant(analysis):
        pairs = [pair for pair in analysis.controllers if pair.first.plant == parts[0].group.plant]
        tables += [failures_by_controller(pairs, sampling), controller_differences(pairs, sampling)]
        k = next(numbers)
        title = f"error against effort on {parts[0].group.plant}"
        verdict = "Each cross spans 90 % of a controller's completed runs and meets at its medians."
        svg = effort_svg([part.group for part in parts], f"f{k}")
        figures.append(Figure(str(k), title, svg, verdict))
    yield Section("controllers", "Controllers", tables=tuple(tables), figures=tuple(figures))


def _plants(analysis: Analysis, numbers: Numbers) -> Iterator[Section]:
    compared = dict.fromkeys((pair.first.plant, pair.second.plant) for pair in analysis.plants)
    for number, plants in enumerate(compared):
        pairs = [pair for pair in analysis.plants if (pair.first.plant, pair.second.plant) == plants]
        yield _two_plants(analysis, pairs, f"plants-{number}" if number else "plants", next(numbers))


def _two_plants(analysis: Analysis, pairs: Sequence[Pair], name: str, k: int) -> Section:
    sampling = analysis.results.campaign.settings.sampling
    one, other = pairs[0].first.plant, pairs[0].second.plant
    svg = plants_svg(pairs, f"f{k}")
    title = f"largest error on {one} and on {other}, the same samples"
    figure = Figure(str(k), title, svg, wording.agreement_sentence(pairs), alone=True)
    tables = [plants_agreement(pairs), failures_by_plant(pairs, sampling)]
    if any(pair.agreement.largest for pair in pairs):
        tables.append(disagreements(analysis, pairs))
    return Section(name, f"{one.capitalize()} and {other}", tables=tuple(tables), figures=(figure,))


def _influence(analysis: Analysis, numbers: Numbers) -> Iterator[Section]:
    campaign = analysis.results.campaign
    names = [campaign.names[k] for k in campaign.varied]
    plants = by_plant(analysis)
    if analysis.groups[0].swings:
        figures = [_tornado(parts, names, next(numbers)) for parts in plants]
        tables = [swings_table(part) for part in analysis.groups]
        yield Section("influence", "What decides", (_STEPS,), tuple(tables), tuple(figures))
        return
    tables = [sobol_table(parts, names) for parts in plants if any(part.sobol for part in parts)]
    figures = [figure for parts in plants for figure in _sobol(parts, names, numbers)]
    if compared_parameters(analysis.results):
        figures += [figure for parts in plants for figure in _correlations(parts, numbers)]
        figures += [_bands(analysis, parts, next(numbers)) for parts in plants]
    if figures:
        few = campaign.settings.sampling == "saltelli" and not tables
        texts = (_SPREAD, _FEW) if few else (_SPREAD,)
        yield Section("influence", "What decides", texts, tuple(tables), tuple(figures))


_SPREAD = (
    "Influence is measured over completed runs. Colour marks what is beyond chance, corrected for the number "
    "of fields; parameters that were sampled with a correlation share their influence."
)
_FEW = f"Sobol indices take {LEAST} base points all of whose runs completed, and an output that varies."
_STEPS = "Each parameter by itself is put at a low and at a high value, the others stay nominal."


def _correlations(parts: Sequence[GroupAnalysis], numbers: Numbers) -> Iterator[Figure]:
    order = np.argsort(-_strengths(parts).max(axis=1), kind="stable")
    for part in parts:
        if part.correlations is not None:
            k = next(numbers)
            svg = correlations_svg(part.correlations, order.tolist(), f"f{k}")
            verdict = wording.correlations_sentence(part.correlations)
            yield Figure(str(k), f"what goes with what, {part.group.name}", svg, verdict)


def _bands(analysis: Analysis, parts: Sequence[GroupAnalysis], k: int) -> Figure:
    strengths = _strengths(parts)[:, MAIN_METRICS.index(MEASURE)]
    leading = _leading(strengths, int((strengths > FAINT).sum()))
    columns = [compared_parameters(analysis.results)[j] for j in leading]
    svg = bands_svg(analysis, parts, columns, f"f{k}")
    title = f"largest error over what goes with it most, {parts[0].group.plant}"
    return Figure(str(k), title, svg, "Median and 5 to 95 % of completed runs, in ranges of equal number.")


def _leading(values: Sequence[float] | Array, beyond_chance: int) -> list[int]:
    """Places of the largest, those `beyond_chance` if there are two at least, and no more than SHOWN."""
    order: list[int] = np.argsort(-np.asarray(values), kind="stable").tolist()
    return order[: min(SHOWN, max(2, beyond_chance))]


def _strengths(parts: Sequence[GroupAnalysis]) -> Array:
    """Of all controllers the strongest, (parameters, metrics); below FAINT what may be chance, in order."""
    found = [part.correlations for part in parts if part.correlations is not None]
    strongest: Array = np.max(
        [each.strength + FAINT * np.abs(np.nan_to_num(each.rho)) for each in found], axis=0
    )
    return strongest


def _tornado(parts: Sequence[GroupAnalysis], names: Sequence[str], k: int) -> Figure:
    column = MAIN_METRICS.index(MEASURE)
    widths = dict.fromkeys(names, 0.0)
    for part in parts:
        for swing in part.swings:
            width = abs(float(swing.metrics[column] - part.group.metrics[MEASURE][0]))
            widths[swing.parameter] = max(widths[swing.parameter], float(np.nan_to_num(width)))
    order = sorted(names, key=lambda name: -widths[name])
    verdict = " ".join(map(wording.tornado_sentence, parts))
    title = f"one parameter at a time on {parts[0].group.plant}"
    return Figure(str(k), title, tornado_svg(parts, order, f"f{k}"), verdict, alone=True)


def _sobol(parts: Sequence[GroupAnalysis], names: Sequence[str], numbers: Numbers) -> Iterator[Figure]:
    """A figure of the first metric, and of each for which other parameters matter than for those before."""
    seen: list[tuple[bytes, ...]] = []
    for metric in MAIN_METRICS:
        having = [part for part in parts if metric in part.sobol]
        matter = tuple(part.sobol[metric].important.tobytes() for part in having)
        if having and matter not in seen:
            seen.append(matter)
            k = next(numbers)
            title = f"Sobol indices of the {metric_name(metric)}, {parts[0].group.plant}"
            verdict = wording.sobol_sentence(having, names, metric)
            yield Figure(str(k), title, sobol_svg(having, names, metric, f"f{k}"), verdict)


def _failures(analysis: Analysis, numbers: Numbers) -> Iterator[Section]:
    figures, tables = [], []
    for parts in by_plant(analysis):
        having = [part for part in parts if part.separations]
        if not having:
            continue
        found = [each for part in having for each in part.separations]
        names = list(dict.fromkeys(each.parameter for each in found))
        distances = [max(each.distance for each in found if each.parameter == name) for name in names]
        beyond = len({each.parameter for each in found if each.significant})
        columns = [analysis.results.campaign.names.index(names[j]) for j in _leading(distances, beyond)]
        k = next(numbers)
        svg = failure_rates_svg(analysis, parts, columns, f"f{k}")
        title = f"failure rate over what separates most, {parts[0].group.plant}"
        figures.append(Figure(str(k), title, svg, wording.failures_sentence(having)))
        tables.append(separation_table(having))
    if figures:
        yield Section("failures", "What fails", tables=tuple(tables), figures=tuple(figures))


def _uncertainty(analysis: Analysis) -> Section:
    software = enumerate(analysis.results.origins, 1)
    settings = analysis.results.campaign.settings
    facts = {
        "scenario": settings.scenario,
        "settings of all runs": ", ".join(settings.set) or "none",
        "sampling": f"{settings.sampling}, seed {settings.seed}",
        "samples": str(analysis.results.campaign.runs),
        "runs": str(len(analysis.results)),
        **{
            name if k == 1 else f"{name}, software {k}": str(version)
            for k, (_, versions) in software
            for name, version in versions.items()
        },
    }
    rows = tuple((Cell(name), Cell(value)) for name, value in facts.items())
    made = Table("What was run, with what", ("", ""), rows, labels=2)
    return Section("uncertainty", "What is uncertain", tables=(uncertainty_table(analysis), made))


def _on_one_line(table: Table) -> Table:
    """A table of the terminal, whose columns are narrow, for the page."""
    rows = tuple(tuple(replace(cell, text=cell.text.replace("\n", "")) for cell in row) for row in table.rows)
    return replace(table, rows=rows)
