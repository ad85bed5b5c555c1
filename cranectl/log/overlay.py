"""Write and read overlays: logs of several runs with a label each, of any controllers, drives and plants.

For each label an overlay holds what the log of that run would hold:

- Metadata and attachments have the label before their names, as `LABEL/scenario.json`.
- Topics have the label in place of the plant, as `/LABEL/load`.
- `/LABEL/reference` is the reference of that run.
- `/LABEL/distance` is its distance from the first run, and `/LABEL/step` from the one before.

Viewers show the first run as a solid crane, and the others as ghosts in their own colours.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np

from cranectl.log import scene
from cranectl.log.consistency import Sampling, check_run
from cranectl.log.events import events, status_changes
from cranectl.log.export import ExportTable, export_table
from cranectl.log.header import OVERLAY, OVERLAY_FORMAT, check_recordable, file_attachments, file_metadata
from cranectl.log.messages import distances, log_lines, recorded, signals, status
from cranectl.log.reader import read_runs
from cranectl.log.topics import Stream, Topics
from cranectl.log.writer import write_container
from cranectl.mcap_columns import DamageError
from cranectl.plants import PLANTS
from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.support import FileKind, InputError, LogError, Palette

MAX_RUNS_SHOWN = len(Palette.VIEWER.series)  # runs of an overlay: each needs its own colour
MAX_LABEL = 40  # characters of a label
LABEL = re.compile(rf"[A-Za-z0-9][A-Za-z0-9_+-]{{,{MAX_LABEL - 1}}}")


@dataclass(frozen=True)
class Layer:
    """A run of a log, with the facts that the log holds about it."""

    run: Run  # what the label names
    every: int  # every n-th control sample is logged
    versions: Mapping[str, str]  # of the software that made it
    from_ns: int | None = None  # start of a segment of a live session


@dataclass(frozen=True)
class Log:
    """The runs of one or several logs, those of an overlay by label, all others by plant."""

    layers: Mapping[str, Layer]  # by label in an overlay, else by plant

    @classmethod
    def read(cls, path: str | Path) -> "Log":
        """Read any log; raise LogError as `read_log` does."""
        read = read_runs(path, overlays=True)
        layers = {
            k: Layer(run, header.every, header.versions, header.from_ns) for k, (header, run) in read.items()
        }
        return cls(layers)

    @classmethod
    def gather(
        cls, paths: Sequence[Path], *, labels: Sequence[str] = (), plants: Sequence[str] = ()
    ) -> "Log":
        """Read the runs of several logs, and give each a label.

        These are all runs of overlays, and from other logs the runs of `plants`, by default the reference
        plant. `labels` names all runs in their order; by default labels are as short as they can differ.
        Raises InputError for invalid labels, and LogError as `read_log` does.
        """
        named: list[tuple[str, str, Layer]] = []  # label in the overlay or nothing, stem of the file, run
        read = [cls.read(path) for path in paths]
        plants = PLANTS.of_logs(plants, {name for log in read if not log.is_overlay for name in log.layers})
        for path, log in zip(paths, read, strict=True):
            layers, labelled = log.layers, log.is_overlay
            selected = layers if labelled else plants or (PLANTS.reference(layers),)
            named += [
                (name if labelled else "", path.stem, layers[name]) for name in selected if name in layers
            ]
        chosen = [layer for _, _, layer in named]
        if not labels:
            short = labels_of([layer.run for layer in chosen], [stem for _, stem, _ in named])
            labels = [own or label for (own, _, _), label in zip(named, short, strict=True)]
        if len(labels) != len(chosen):
            raise InputError(
                f"{len(labels)} labels for {len(chosen)} runs",
                allowed="one label for each run",
                remedy="give --label once for each run, or not at all",
            )
        check_labels(labels)
        return cls(dict(zip(labels, chosen, strict=True)))

    @property
    def runs(self) -> dict[str, Run]:
        """The runs by plant or label."""
        return {name: layer.run for name, layer in self.layers.items()}

    @property
    def is_overlay(self) -> bool:
        """Whether runs have labels; those of other logs have the names of their plants."""
        return any(label != layer.run.plant for label, layer in self.layers.items())

    @property
    def first(self) -> Layer:
        """The first run; without labels, all have its scenario, its controller and its facts."""
        return next(iter(self.layers.values()))

    def table(self, patterns: Sequence[str] = ()) -> ExportTable:
        """Return the table of all signals that match any of `patterns`; see `export_table`."""
        return export_table(self.runs, patterns)

    def write_overlay(self, path: Path) -> None:
        """Write an overlay of the runs; raise InputError for invalid labels, LogError if writing fails."""
        write_overlay(path, self.layers)


def check_labels(labels: Sequence[str]) -> None:
    """Raise InputError unless these labels are valid and different."""
    identifiers = [re.sub(r"\W", "_", label) for label in labels]  # for tools that allow no other characters
    for label, name in zip(labels, identifiers, strict=True):
        if not LABEL.fullmatch(label) or label in PLANTS or identifiers.count(name) > 1:
            raise InputError(
                f"the label '{label}' is not valid",
                allowed=f"different labels of up to {MAX_LABEL} letters, digits, '_', '+', '-', "
                "and no name of a plant",
                remedy="choose other labels with --label",
            )
    if not 0 < len(labels) <= MAX_RUNS_SHOWN:
        raise InputError(
            f"an overlay of {len(labels)} runs",
            allowed=f"1 to {MAX_RUNS_SHOWN} runs, as many as there are colours",
            remedy="name more or fewer runs",
        )


def labels_of(runs: Sequence[Run], stems: Sequence[str]) -> list[str]:
    """Return short, different labels for `runs` from the files with these `stems`.

    A label has the parts of CONTROLLER-DRIVE-PLANT in which the runs differ, after SCENARIO- if there are
    several scenarios. If runs do not differ in these, the stems are the labels. If stems do not differ
    either, the controllers' names are numbered.
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
    # Three characters are left for the hyphen and a number.
    return [f"{_fitting(run.design.name)[: MAX_LABEL - 3]}-{k}" for k, run in enumerate(runs, 1)]


def _fitting(label: str) -> str:
    return re.sub(r"[^A-Za-z0-9_+]+", "-", label)[:MAX_LABEL].strip("-_+")


def write_overlay(path: Path, layers: Mapping[str, Layer]) -> None:
    """Write an overlay of runs by label; raise InputError for invalid labels, LogError if writing fails."""
    check_labels([*layers])
    FileKind.MCAP.check_place(path, option="--out")
    metadata = {OVERLAY: {"format": OVERLAY_FORMAT, "labels": ",".join(layers)}}
    attachments = []
    for label, layer in layers.items():
        check_recordable(layer.run.scenario, layer.run.design, layer.run.drive)
        try:
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
    with np.errstate(invalid="ignore"):  # the last sample of a stopped run may not be finite
        sent = list(_streams([replace(layer.run, plant=label) for label, layer in layers.items()]))
    write_container(path, metadata, attachments, sent)


def _streams(runs: Sequence[Run]) -> Iterator[Stream]:
    """Yield the streams of an overlay; the plants of `runs` are replaced by their labels."""
    yield log_lines(event for run in runs for event in events(run))
    for run in runs:
        yield status(run.plant, status_changes(run))
        yield from recorded(run)
        if run.has_reference:
            reference = Topics(run.plant).reference
            yield signals(reference, SignalGroup.REFERENCE, run.time_ns, run.reference)
    for before, run in pairwise(runs):
        for kind, other in ((Topics.DISTANCE.name, runs[0]), (Topics.STEP, before)):
            both = run.has("state", "load") and other.has("state", "load")
            if both and np.intersect1d(run.time_ns, other.time_ns).size:
                yield distances(Topics(run.plant).of(kind), run, other)
    coloured = zip(Palette.VIEWER.series, runs, strict=False)
    drawn = {colour: run for colour, run in coloured if scene.can_be_drawn(run)}
    if not drawn:
        return
    longest, solid = max(drawn.values(), key=lambda run: run.end_ns), next(iter(drawn.values()))
    rows = scene.frames(longest)
    yield scene.transforms([*drawn.values()], longest, rows)
    if longest.has_reference:
        yield scene.path(longest)
    yield from (scene.workspace(solid), scene.all_arrows(solid))
    for colour, run in drawn.items():
        opacity = 1.0 if run is solid else scene.GHOST
        yield scene.model(run.plant, run.scenario.rig, opacity, colour=colour)
        yield scene.rope(run, opacity, scene.frames(run))
        yield scene.whole_trail(run, 1.0, colour=colour)
