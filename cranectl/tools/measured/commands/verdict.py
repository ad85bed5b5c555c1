"""What commands do with measured logs: `compare` predicts them, `validate` judges them."""

import re
import shlex
from collections.abc import Sequence
from contextlib import suppress
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cranectl import log as log_files
from cranectl import support
from cranectl.cli.command import Command
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.output import Screen
from cranectl.cli.refused_options import refuse_options
from cranectl.plants import PLANTS
from cranectl.report import Cell, Table
from cranectl.signals import SignalGroup
from cranectl.support import FileKind, InputError, JUnitCase
from cranectl.tools import measured as measured_cranes
from cranectl.tools.measured.commands.files import MeasuredRuns

if TYPE_CHECKING:
    from cranectl.simulate import Run
    from cranectl.tools.measured.replay import Replay

MEASURED_LABEL = "measured-crane"  # in an overlay
# Options of `validate` for measured runs.
JUDGED_OPTIONS = ("scenarios", "rig", "map_file", "sheets", "tolerance", "junit", "report", "json_file")
SHOWN = {"m": (1e3, "mm"), "rad": (degrees(1.0), "°")}


def compare_measured(
    log: Path,
    measured: "log_files.Layer",
    plants: tuple[str, ...],
    *,
    replay: "Replay | None",
    out: Path | None,
    screen: Screen,
) -> int:
    """Print measured minus predicted of each signal, and write both as an overlay to `out`."""
    import numpy as np

    if out is not None:
        FileKind.MCAP.check_place(out, inputs=[log], option="--out")
    run = measured.run
    replayed = replay or measured_cranes.default_replay(run)
    rig = run.scenario.rig
    own = rig.model if replayed != "motion" and rig.model and Path(rig.model).is_file() else None
    names = plants or (PLANTS.REFERENCE, *((PLANTS.find(own).name,) if own else ()))
    for entry in (PLANTS.find(plant, rig) for plant in names):
        if replayed == "motion" and "ideal" not in entry.drives:
            raise InputError(
                f"--replay motion on the {entry.label} plant, which cannot move its axes as measured",
                allowed="plants with ideal drives, or --replay commands",
                remedy="take --replay commands, or other --plants",
            )
    predicted = {plant: measured_cranes.predict(run, plant, replayed) for plant in names}
    summaries = {plant: _residuals(prediction) for plant, prediction in predicted.items()}
    for plant, prediction in predicted.items():
        title = f"measured minus predicted, {plant}, {measured_cranes.REPEATED[replayed]}"
        screen.print(residual_table(title, summaries[plant]))
        distance = prediction.load_residual
        worst = int(np.argmax(distance))
        screen.print(
            f"the loads are at most {1e3 * distance[worst]:.3g} mm apart, at {prediction.time[worst]:g} s"
        )
        if prediction.status.stopped:
            screen.print(f"the prediction ended early: {prediction.status.label} at {prediction.end_s:g} s")
    if out is not None:
        labelled = {
            f"predicted-{plant}": log_files.Layer(p, 1, support.Provenance.now())
            for plant, p in predicted.items()
        }
        log_files.Log({MEASURED_LABEL: measured, **labelled}).write_overlay(out)
        screen.print(f"log: {out}")
        screen.print(f"see it over time: cranectl report {shlex.quote(str(out))}")
    screen.write_json(
        {
            "replay": replayed,
            "predictions": [
                {"plant": plant, "status": p.status.label, "end_s": p.end_s, "residuals": summaries[plant]}
                for plant, p in predicted.items()
            ],
        }
    )
    return ExitCode.GOOD


def residual_table(title: str, residuals: Sequence[dict[str, Any]]) -> Table:
    """Return the largest residual of each signal in mm or degrees, and when it occurs."""
    rows = []
    for row in residuals:
        factor, unit = SHOWN[row["unit"]]
        sizes = (f"{factor * row[name]:.3f}" for name in ("max_abs", "rms", "final"))
        largest, *others = sizes
        rows.append(
            Cell.row(row["signal"].removesuffix("_residual"), unit, largest, f"{row['at_s']:g}", *others)
        )
    return Table(title, ("signal", "unit", "largest", "at [s]", "RMS", "final"), tuple(rows), labels=2)


def _residuals(prediction: "Run") -> list[dict[str, Any]]:
    """Return sizes and times of the residuals of a prediction as plain data, in SI units."""
    import numpy as np

    residuals = []
    for signal, values in zip(SignalGroup.RESIDUAL.signals, prediction.block("residual").T, strict=True):
        worst = int(np.argmax(np.abs(values)))
        residuals.append(
            {
                "signal": signal.name,
                "unit": signal.unit,
                "max_abs": float(np.abs(values[worst])),
                "at_s": float(prediction.time[worst]),
                "rms": float(np.sqrt(np.mean(values**2))),
                "final": float(values[-1]),
            }
        )
    return residuals


def is_measured(name: str) -> bool:
    """Return whether a name is that of a measured file, and of no scenario: it ends, but not in .toml."""
    path = Path(name)
    with suppress(OSError, ValueError):  # no name of a file
        if path.is_dir() or path.suffix.lower() == ".toml":
            return False
        return bool(path.suffix) or path.is_file()
    return False


def judge_runs(
    names: tuple[str, ...],
    rig: Path | str | None,
    *,
    map_file: Path | None,
    sheets: str | None,
    tolerance: str | None,
    junit: Path | None,
    report: Path | None,
    screen: Screen,
) -> int:
    """Judge measured runs by an identified crane, and tell the answers; return the exit code."""
    context = click.get_current_context()
    given = {
        str(option.opts[0]): context.get_parameter_source(str(option.name))
        is click.core.ParameterSource.COMMANDLINE
        for option in context.command.params
        if option.name not in JUDGED_OPTIONS
    }
    allowed = "--rig, --map, --sheets, --tolerance, --junit, --report and --json"
    refuse_options(given, "with measured runs", allowed=allowed)
    if others := [name for name in names if not is_measured(name)]:
        raise InputError(
            f"{others[0]} beside measured runs, or an option for these with it",
            allowed="either scenarios, or measured runs with --rig, --map and --tolerance",
            remedy="judge scenarios and measured runs by two commands",
        )
    if not names or rig is None:
        raise InputError(
            "measured runs without the crane that judges them"
            if names
            else "options for measured runs, and no runs",
            allowed="logs of `cranectl log import`, or files with --map, and the rig of `cranectl identify`",
            remedy="cranectl validate LOG --rig identified.toml --tolerance 5mm",
        )
    accepted = None if tolerance is None else _length(tolerance)
    fit = measured_cranes.Fit.read(Path(rig))
    files = [Path(name) for name in names]
    measured = MeasuredRuns.read(files, map_file=map_file, sheets=sheets, rig=str(rig), screen=screen)
    runs, repeated = _distinct_runs(measured.runs)
    verdicts = measured_cranes.judge(runs, fit, tolerance=accepted)
    good = [
        verdict.answer in (measured_cranes.COVERED, measured_cranes.WITHIN_TOLERANCE) for verdict in verdicts
    ]
    screen.print(measured_cranes.VerdictReport.table(verdicts))
    for verdict in verdicts:
        screen.print_each(
            f"{verdict.name}: {t}"
            for t in (
                measured_cranes.VerdictReport.explanation(verdict, accepted),
                *measured_cranes.VerdictReport.asides(verdict),
            )
        )
    screen.print(measured_cranes.VerdictReport.sentence(verdicts))
    screen.print_each(
        f"{name} is given twice, and judged once"
        if name == first
        else f"{name} has the readings of {first}, and is judged with it"
        for name, first in repeated
    )
    same = [{"name": name, "same_as": first} for name, first in repeated]
    facts = [verdict.to_json() for verdict in verdicts]
    screen.write_json(
        {"tolerance_m": accepted, "verdicts": facts, "repeated": same, "imported": measured.imported}
    )
    if junit is not None:
        again = f"again: {Command.given()}"
        cases = [
            JUnitCase(
                str(rig),
                v.name,
                "passed" if passed else "failed",
                (measured_cranes.VerdictReport.explanation(v, accepted), again),
            )
            for v, passed in zip(verdicts, good, strict=True)
        ]
        screen.save_junit(cases, junit)
    if report is not None:
        screen.save_page(measured_cranes.VerdictReport.page(verdicts, accepted, Command.given()), report)
    return ExitCode.GOOD if all(good) else ExitCode.LIMIT_EXCEEDED


def _distinct_runs(
    named: Sequence[tuple[str, "Run"]],
) -> tuple[dict[str, "Run"], list[tuple[str, str]]]:
    """Return measured runs by name, and each further name of one with the name of the first."""
    runs: dict[str, Run] = {}
    traces: dict[str, measured_cranes.Trace] = {}
    repeated = []
    for name, run in named:
        trace = measured_cranes.Trace.of(run)
        same = (
            [*traces].index(name)
            if name in traces
            else measured_cranes.repeated_in(trace, [*traces.values()])
        )
        if same is None:
            runs[name], traces[name] = run, trace
        else:
            repeated.append((name, [*traces][same]))
    return runs, repeated


def _length(text: str) -> float:
    """Return a length such as 5mm in metres."""
    match = re.fullmatch(r"([0-9.]+(?:e-?\d+)?)\s*(m|cm|mm)", text)
    if match is None or not float(match[1]) > 0.0:
        raise InputError(
            f"--tolerance {text}",
            allowed="a length with its unit: m, cm or mm",
            remedy="write --tolerance 5mm",
        )
    return float(match[1]) * measured_cranes.LENGTHS[match[2]]
