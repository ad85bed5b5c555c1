"""Identify two public rigs from one half of their runs, and judge the other half; then exchange the halves.

    .venv/bin/python -m validation.proofs.measured_rigs --gantry DIR --container DIR --out rigs.json

The directories are copies of Cristian-Napitupulu/gantry_crane_model_optimizer and mateBakos/CraneControl at
GitHub. They have no licence, so nothing of them is part of this project but names of columns and sizes.
Cameras and potentiometers there see angles; the drives get voltages. So the measured motion drives the model.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.scenario.load import RigFile
from cranectl.simulate import Run
from cranectl.support.errors import InputError
from cranectl.tools.measured.fit import Fit
from cranectl.tools.measured.identification import identify
from cranectl.tools.measured.identified import rig_text
from cranectl.tools.measured.importing import LogSource, import_runs, sources_of
from cranectl.tools.measured.mapping import MeasuredMap
from cranectl.tools.measured.verdict import RunVerdict, answer_for, judge

MAPS = Path(__file__).with_name("measured-rigs")
TOLERANCES = (0.005, 0.010, 0.020)  # [m]
RUNS = {  # files of each rig, of one state of it; the trolley hardly moves in the gantry's files of 600
    "gantry": [f"data/trolley_step_response_{pwm}_with_random.xlsx" for pwm in range(625, 751, 25)],
    "container": [f"Simulation_results/{k}_*.mat" for k in range(17, 25)],
}
HALVES = (0, 1)


def imported_runs(rig: str, directory: Path) -> dict[str, Run]:
    """Return the runs of a rig by name, in the order of their files; a sheet of a workbook is a run."""
    mapping = MeasuredMap.read(MAPS / f"{rig}-map.toml")
    sources: list[LogSource] = []
    for pattern in RUNS[rig]:
        (path,) = directory.glob(pattern)
        sheets = "*" if path.suffix == ".xlsx" else None
        sources += sources_of(path, sheets, mapping.layout)
    logs = import_runs(sources, mapping, directory=MAPS)
    return {source.name: log.run for source, log in zip(sources, logs, strict=True)}


def half_results(rig: str, runs: Mapping[str, Run], half: int, scratch: Path) -> dict[str, Any]:
    """Identify a rig from every second run, and return its numbers and the answers for the others."""
    names = list(runs)
    used, new = names[half::2], {name: runs[name] for name in names[1 - half :: 2]}
    known, fitted = MAPS / f"{rig}.toml", [runs[name] for name in used]
    result = identify(fitted, RigFile.load(str(known)), replay="motion", progress=print)
    identified = scratch / f"{rig}-{half}.toml"
    identified.write_text(rig_text(result, str(known), ", ".join(used)), encoding="utf-8")
    Fit.path(identified).write_text(Fit.text(result, fitted), encoding="utf-8")
    fit = Fit.read(identified)
    verdicts = judged_runs(new, fit)
    return {
        "numbers": {e.name: {"value": e.value, "half_width": e.half_width} for e in result.estimates},
        "converged": result.converged,
        "misfit": result.misfit,
        "runs": {verdict.name: {**distances(verdict), "answers": answers(verdict)} for verdict in verdicts},
        "refused": [name for name in new if name not in {verdict.name for verdict in verdicts}],
    }


def judged_runs(runs: Mapping[str, Run], fit: Fit) -> list[RunVerdict]:
    """Return the verdicts of the runs that can be judged; those that begin in motion are refused."""
    verdicts: list[RunVerdict] = []
    for name, run in runs.items():
        try:
            verdicts += judge({name: run}, fit)
        except InputError as error:
            print(error.found)
    return verdicts


def answers(verdict: RunVerdict) -> dict[str, list[str]]:
    """Return answer and reason with each tolerance."""
    return {f"{1000 * size:g} mm": [*answer_for(verdict, size)] for size in TOLERANCES}


def distances(verdict: RunVerdict) -> dict[str, float]:
    """Return how far the load is from its prediction, over all samples [mm], and the widest band."""
    distance, band = 1000.0 * verdict.load.distance, 1000.0 * verdict.load.band
    return {
        "rms_mm": float(np.sqrt(np.mean(distance**2))),
        "largest_mm": float(distance.max()),
        "band_mm": float(np.nanmax(band)),
    }


def table(results: Mapping[str, Any]) -> str:
    """Return the results as a table of Markdown: a row for each rig and half."""
    sizes = [f"{1000 * size:g} mm" for size in TOLERANCES]
    lines = [
        "| rig, runs that were predicted | RMS: median | largest: median, of all | "
        + " | ".join(f"answers at {size}" for size in sizes)
        + " |",
        "|---" * (3 + len(sizes)) + "|",
    ]
    for rig, halves in results.items():
        for half, result in zip(HALVES, halves, strict=True):
            runs = result["runs"].values()
            rms, largest = ([run[key] for run in runs] for key in ("rms_mm", "largest_mm"))
            counts = []
            for size in sizes:
                given = [run["answers"][size][0] for run in runs]
                counts.append(", ".join(f"{given.count(answer)} {answer}" for answer in dict.fromkeys(given)))
            lines.append(
                f"| {rig}, {len(runs)} {('even', 'odd')[half]} runs | {np.median(rms):.2f} mm "
                f"| {np.median(largest):.1f}, {max(largest):.1f} mm | {' | '.join(counts)} |"
            )
    return "\n".join(lines)


def main() -> None:
    """Print the table, and write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    for rig in RUNS:
        parser.add_argument(f"--{rig}", type=Path, metavar="DIR", help="copy of the repository of this rig")
    parser.add_argument("--out", type=Path, default=Path("measured-rigs.json"), help="results")
    arguments = parser.parse_args()
    results: dict[str, Any] = {}
    for rig in RUNS:
        directory = getattr(arguments, rig)
        if directory is None:
            continue
        runs = imported_runs(rig, directory)
        results[rig] = [half_results(rig, runs, half, arguments.out.parent) for half in HALVES]
        arguments.out.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    print(table(results))


if __name__ == "__main__":
    main()
