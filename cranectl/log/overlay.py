"""Several runs of one scenario in one log, to be looked at on top of each other.

Topics are those of a log, with a label in place of the plant: `/LABEL/load`. The last run is drawn as a
crane, of the others the trails. Such a file is for viewers; `read_log` reads logs of one or two plants.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cranectl.log import scene
from cranectl.log.events import events, status_changes
from cranectl.log.messages import log_lines, samples, signals, status
from cranectl.log.topics import Stream
from cranectl.log.writer import check_writable, file_attachments, write_container
from cranectl.signals import Signal, SignalGroup
from cranectl.simulate import Run
from cranectl.support.colours import VIEWER_SERIES
from cranectl.support.provenance import provenance

GROUPS = ("state", "load", "error", "input")
CRANE = "overlay"  # label of the crane that is drawn
DISTANCE = f"/{CRANE}/distance"


def write_overlay(path: Path, runs: Mapping[str, Run], *, every: int) -> None:
    """Write the runs by their labels, every n-th sample; raises LogError if that cannot be done.

    Distances of the loads are from the first run's.
    """
    check_writable(path)
    labelled = [replace(run.every(every), plant=label) for label, run in runs.items()]
    metadata = {
        "overlay": {"labels": ",".join(runs), "scenario": labelled[-1].scenario.name},
        "versions": provenance(),
    }
    write_container(path, metadata, file_attachments(labelled[-1:]), _streams(labelled))


def distance_group(labels: list[str]) -> SignalGroup:
    """How far the load of each run is from that of the first."""
    distances = tuple(
        Signal(label, f"|Δz| {label}", "m", f"distance of the load of {label} from that of {labels[0]}")
        for label in labels[1:]
    )
    return SignalGroup("distance", f"Distance{len(distances)}", "distances of the loads", distances)


def _streams(runs: list[Run]) -> list[Stream]:
    result = [log_lines(event for run in runs for event in events(run))]
    result += [status(run.plant, status_changes(run)) for run in runs]
    result += samples(runs, groups=GROUPS)
    drawn = [run for run in runs if len(run.time_ns)]
    if not drawn:
        return result
    longest = max(drawn, key=lambda run: len(run.time_ns))
    if len(drawn) > 1:
        result.append(_distances(drawn, longest))
    top = replace(drawn[-1], plant=CRANE)
    result.append(status(CRANE, status_changes(top)))
    rows = scene.rows_apart(top, 1.0 / scene.RATE)
    result += [scene.path(longest), scene.workspace(top), scene.transforms([top], top, rows)]
    result += [scene.model(top.plant, top.scenario.rig, 1.0), scene.rope(top, 1.0, rows)]
    for k, run in enumerate(drawn):
        result.append(scene.whole_trail(run, colour=VIEWER_SERIES[k % len(VIEWER_SERIES)]))
    return result


def _distances(runs: list[Run], longest: Run) -> Stream:
    """On the times of the longest run; NaN after the end of a shorter one."""
    first, *others = (run.load_position for run in runs)
    table = np.full((len(longest.time_ns), len(others)), np.nan)
    for k, load in enumerate(others):
        common = min(len(first), len(load))
        table[:common, k] = np.linalg.norm(load[:common] - first[:common], axis=1)
    group = distance_group([run.plant for run in runs])
    return signals(DISTANCE, group, longest.time_ns, table)
