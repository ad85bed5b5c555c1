"""Compare a measured log with its predictions, for `cranectl compare`."""

import shlex
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cranectl.cli import exit_codes
from cranectl.cli.output import Screen
from cranectl.support.files import MCAP, check_place

if TYPE_CHECKING:
    from cranectl.log.overlay import Layer
    from cranectl.measured.replay import Replay
    from cranectl.report.table import Table
    from cranectl.simulate import Run

MEASURED_LABEL = "measured-crane"  # in an overlay
SHOWN = {"m": (1e3, "mm"), "rad": (degrees(1.0), "°")}


def compare_measured(
    log: Path,
    measured: "Layer",
    plants: tuple[str, ...],
    *,
    replay: "Replay | None",
    out: Path | None,
    screen: Screen,
) -> int:
    """Print measured minus predicted of each signal, and write both as an overlay to `out`."""
    from cranectl.log.overlay import Layer, write_overlay
    from cranectl.measured.replay import default_replay, predict
    from cranectl.plants.registry import REFERENCE_PLANT
    from cranectl.support.provenance import provenance

    if out is not None:
        check_place(out, MCAP, inputs=[log], option="--out")
    run = measured.run
    replayed = replay or default_replay(run)
    predicted = {plant: predict(run, plant, replayed) for plant in plants or (REFERENCE_PLANT,)}
    for plant, prediction in predicted.items():
        screen.print(residual_table(f"measured minus predicted, {plant}, {replayed} repeated", prediction))
        distance = np.linalg.norm(prediction.block("residual")[:, 5:], axis=1)
        worst = int(np.argmax(distance))
        screen.print(
            f"the loads are at most {1e3 * distance[worst]:.3g} mm apart, at {prediction.time[worst]:g} s"
        )
        if prediction.status.stopped:
            screen.print(f"the prediction ended early: {prediction.status.label} at {prediction.end_s:g} s")
    if out is not None:
        labelled = {f"predicted-{plant}": Layer(p, 1, provenance()) for plant, p in predicted.items()}
        write_overlay(out, {MEASURED_LABEL: measured, **labelled})
        screen.print(f"log: {out}")
        screen.print(f"see it over time: cranectl report {shlex.quote(str(out))}")
    screen.write_json(
        {
            "replay": replayed,
            "predictions": [{"plant": plant, **_plain(run)} for plant, run in predicted.items()],
        }
    )
    return exit_codes.GOOD


def residual_table(title: str, prediction: "Run") -> "Table":
    """Return the largest residual of each signal in mm or degrees, and when it occurs."""
    from cranectl.report.table import Table, cells

    rows = []
    for row in _plain(prediction)["residuals"]:
        factor, unit = SHOWN[row["unit"]]
        sizes = (f"{factor * row[name]:.3f}" for name in ("max_abs", "rms", "final"))
        largest, *others = sizes
        rows.append(
            cells(row["signal"].removesuffix("_residual"), unit, largest, f"{row['at_s']:g}", *others)
        )
    return Table(title, ("signal", "unit", "largest", "at [s]", "RMS", "final"), tuple(rows), labels=2)


def _plain(prediction: "Run") -> dict[str, Any]:
    """Return the residuals of a prediction as plain data, in SI units."""
    from cranectl.signals import RESIDUAL

    residuals = []
    for signal, values in zip(RESIDUAL.signals, prediction.block("residual").T, strict=True):
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
    return {"status": prediction.status.label, "end_s": prediction.end_s, "residuals": residuals}
