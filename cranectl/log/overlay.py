"""Runs by label in one log: of several controllers, drives or plants, or the levels of a ladder.

Such an overlay holds a log of one run for each label. Its metadata and attachments have the label before
their names, `LABEL/scenario.json`; its topics have it in place of the plant, `/LABEL/load`.
`/LABEL/reference` is what that run was to follow, `/LABEL/distance` how far it is from the first run and
`/LABEL/step` from the one before. The first is drawn as a crane, the others as ghosts in their own colours.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np

from cranectl.log import scene, topics
from cranectl.log.consistency import Sampling, check_design, check_run
from cranectl.log.events import events, status_changes
from cranectl.log.header import (
    OVERLAY,
    OVERLAY_FORMAT,
    check_recordable,
    file_attachments,
    file_metadata,
)
from cranectl.log.messages import distances, log_lines, recorded, signals, status
from cranectl.log.reader import read_runs
from cranectl.log.topics import Stream
from cranectl.log.writer import check_writable, write_container
from cranectl.mcap_columns.records import DamageError
from cranectl.plants.registry import PLANTS, plants_of_logs, reference_plant
from cranectl.signals import REFERENCE
from cranectl.simulate import Run
from cranectl.support.colours import VIEWER_SERIES
from cranectl.support.errors import InputError, LogError

STEP = "step"  # how far a run is from the one before it
MOST = len(VIEWER_SERIES)  # as many as there are colours
MAX_LABEL = 40  # letters of a label, which begins names in tables
LABEL = re.compile(rf"[A-Za-z0-9][A-Za-z0-9_+-]{{,{MAX_LABEL - 1}}}")


@dataclass(frozen=True)
class Layer:
    """A run of a log, and what else the log says of it."""

    run: Run
    every: int  # logged every n-th control sample
    versions: Mapping[str, str]  # of what made it
    from_ns: int | None = None  # where a segment of a live session begins


def read_layers(path: str | Path) -> dict[str, Layer]:
    """Read the runs of any log: by label those of an overlay, by plant those of others.

    Raises LogError as `read_log` does.
    """
    return {
        name: Layer(run, header.every, header.versions, header.from_ns)
        for name, (header, run) in read_runs(path, overlays=True).items()
    }


def is_overlay(layers: Mapping[str, Layer]) -> bool:
    """Return True if runs have labels; those of other logs have the names of their plants."""
    return any(label != layer.run.plant for label, layer in layers.items())


def check_labels(labels: Sequence[str]) -> None:
    """Raise InputError unless these labels tell runs apart in a log."""
    shown = [re.sub(r"\W", "_", label) for label in labels]  # where no other signs can be
    for label, name in zip(labels, shown, strict=True):
        if not LABEL.fullmatch(label) or label in PLANTS or shown.count(name) > 1:
            raise InputError(
                f"the label '{label}'",
                allowed=f"up to {MAX_LABEL} letters, digits, '_', '+', '-', each once, "
                "and no name of a plant",
                remedy="choose other labels with --label",
            )
    if not 0 < len(labels) <= MOST:
        raise InputError(
            f"an overlay of {len(labels)} runs",
            allowed=f"1 to {MOST}, as many as there are colours",
            remedy="name more or fewer runs",
        )


def gathered(
    paths: Sequence[Path], *, labels: Sequence[str] = (), plants: Sequence[str] = ()
) -> dict[str, Layer]:
    """Return the runs of several logs by label: all of an overlay, those of `plants` of other logs.

    By default that of the reference plant. `labels`: of all runs in their order, by default as short as they
    differ. Raises InputError for labels that cannot be, and LogError as `read_log` does.
    """
    named: list[tuple[str, str, Layer]] = []  # own label or none, stem of the file, run
    read = [read_layers(path) for path in paths]
    plants = plants_of_logs(plants, {name for layers in read if not is_overlay(layers) for name in layers})
    for path, layers in zip(paths, read, strict=True):
        whole = is_overlay(layers)
        wanted = layers if whole else plants or (reference_plant(layers),)
        named += [(name if whole else "", path.stem, layers[name]) for name in wanted if name in layers]
    runs_found = [layer for _, _, layer in named]
    if not labels:
        short = labels_of([layer.run for layer in runs_found], [stem for _, stem, _ in named])
        labels = [own or label for (own, _, _), label in zip(named, short, strict=True)]
    if len(labels) != len(runs_found):
        raise InputError(
            f"{len(labels)} labels of {len(runs_found)} runs",
            allowed="a label for each run",
            remedy="say --label once for each run, or not at all",
        )
    check_labels(labels)
    return dict(zip(labels, runs_found, strict=True))


def labels_of(runs: Sequence[Run], stems: Sequence[str]) -> list[str]:
    """CONTROLLER-DRIVE-PLANT, as much of it as tells the runs apart; else the stems of their files.

    After SCENARIO- where runs have several. Numbered where neither tells them apart.
    """
    names = [(run.scenario.name, run.design.name, run.drive, run.plant) for run in runs]
    several = len({scenario for scenario, *_ in names}) > 1
    parts = [
        parts_shown
        for size in range(1, 5)
        for parts_shown in combinations(range(4), size)
        if (0 in parts_shown) == several
    ]
    choices = [["-".join(name[k] for k in parts_shown) for name in names] for parts_shown in parts]
    for choice in (*choices, stems):
        labels = [_fitting(label) for label in choice]
        if len({*labels} - {*PLANTS, ""}) == len(runs):
            return labels
    return [f"{_fitting(run.design.name)[: MAX_LABEL - 3]}-{k}" for k, run in enumerate(runs, 1)]


def _fitting(label: str) -> str:
    return re.sub(r"[^A-Za-z0-9_+]+", "-", label)[:MAX_LABEL].strip("-_+")


def write_overlay(path: Path, layers: Mapping[str, Layer]) -> None:
    """Write the runs by their labels; raises InputError for labels, LogError if it cannot be done."""
    check_labels([*layers])
    check_writable(path)
    metadata = {OVERLAY: {"format": OVERLAY_FORMAT, "labels": ",".join(layers)}}
    attachments = []
    for label, layer in layers.items():
        check_recordable(layer.run.scenario, layer.run.design, layer.run.drive)
        try:
            check_design(layer.run.design)
            check_run(layer.run, Sampling(layer.run.scenario, layer.every, layer.from_ns))
        except DamageError as error:
            raise LogError(
                f"cannot write {path}: {label} would contradict itself: {error}",
                allowed="runs whose parts agree",
                remedy=f"run {label} again",
            ) from None
        records = {**file_metadata([layer.run], layer.every), "versions": dict(layer.versions)}
        if layer.from_ns is not None:
            records["live"] = {"from_ns": str(layer.from_ns)}
        metadata |= {f"{label}/{name}": record for name, record in records.items()}
        own = file_attachments([layer.run])
        attachments += [replace(attachment, name=f"{label}/{attachment.name}") for attachment in own]
    with np.errstate(invalid="ignore"):  # of a last sample that may hold what stopped its run
        sent = list(_streams([replace(layer.run, plant=label) for label, layer in layers.items()]))
    write_container(path, metadata, attachments, sent)


def _streams(runs: Sequence[Run]) -> Iterator[Stream]:
    """Yield the topics of runs whose plants are called by their labels."""
    yield log_lines(event for run in runs for event in events(run))
    for run in runs:
        yield status(run.plant, status_changes(run))
        yield from recorded(run)
        yield signals(topics.plant_topic(run.plant, topics.TARGET), REFERENCE, run.time_ns, run.reference)
    for before, run in pairwise(runs):
        for kind, other in ((topics.DISTANCE.name, runs[0]), (STEP, before)):
            if np.intersect1d(run.time_ns, other.time_ns).size:
                yield distances(topics.plant_topic(run.plant, kind), run, other)
    drawn = {colour: run for run, colour in zip(runs, VIEWER_SERIES, strict=False) if len(run.time_ns)}
    if not drawn:
        return
    longest, solid = max(drawn.values(), key=lambda run: run.end_ns), next(iter(drawn.values()))
    rows = scene.rows_apart(longest, 1.0 / scene.RATE)
    yield from (scene.transforms([*drawn.values()], longest, rows), scene.path(longest))
    yield from (scene.workspace(solid), scene.all_arrows(solid))
    for colour, run in drawn.items():
        opacity = 1.0 if run is solid else scene.GHOST
        yield scene.model(run.plant, run.scenario.rig, opacity, colour=colour)
        yield scene.rope(run, opacity, scene.rows_apart(run, 1.0 / scene.RATE))
        yield scene.whole_trail(run, 1.0, colour=colour)
