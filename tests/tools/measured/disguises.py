"""Logs that hold the same readings in other clothes: a fit must know them again as data that it used."""

from collections.abc import Iterator

import numpy as np

from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.tools.measured.experiment import CHANNELS
from tests.tools.measured.hidden import COMMANDS, imported, signals_of

ANOTHER_PERIOD = 1.3  # times the period of the log
SHIFT = 0.37  # of a period
ZERO = 0.004  # [rad]


def columns_of(run: Run) -> dict[str, Array]:
    """Return the columns of the file that an imported run with commands comes from."""
    tables = np.hstack([run.block("state")[:, 0::2], run.block("command")[:, :3]])
    return {"t": run.time, **dict(zip((*CHANNELS, *COMMANDS), tables.T, strict=True))}


def disguises(run: Run) -> Iterator[tuple[str, Run]]:
    """Yield names of ten disguises, and the run as an import gives it in each of them."""
    rig, columns = run.scenario.rig, columns_of(run)
    period, signals = float(run.time[1]), signals_of(dict.fromkeys((*CHANNELS, *COMMANDS), run.time))

    def rows(first: int, last: int | None = None) -> dict[str, Array]:
        return {name: values[first:last] for name, values in columns.items()}

    turned = {name: {**keys, "sign": -1} for name, keys in signals.items()}
    mirrored = {name: values if name == "t" else -values for name, values in reversed(columns.items())}
    yield (
        "another file, columns in another order and with other signs",
        imported(rig, mirrored, turned, file="other.csv", name="other", title="another day"),
    )
    yield "first row cut", imported(rig, rows(1), signals)
    yield "first second cut", imported(rig, columns, signals, **{"from": 1.0})
    yield "last rows cut", imported(rig, rows(0, -7), signals)
    beta = columns["beta"].copy()
    beta[len(beta) // 2] += 1e-9
    yield "one reading changed by 1e-9", imported(rig, {**columns, "beta": beta}, signals)
    units = {"m": ("mm", 1e3), "rad": ("deg", 180.0 / np.pi), "m/s": ("mm/s", 1e3)}
    factors = {name: units[keys["unit"]][1] for name, keys in signals.items()}
    scaled = {name: factors.get(name, 1.0) * values for name, values in columns.items()}
    others = {name: {**keys, "unit": units[keys["unit"]][0]} for name, keys in signals.items()}
    yield "other units", imported(rig, scaled, others)
    zeros = {name: {**signals[name], "zero": ZERO} for name in ("alpha", "beta")}
    yield "other zeros of the angles", imported(rig, columns, {**signals, **zeros})
    yield "another period", imported(rig, columns, signals, period=round(ANOTHER_PERIOD * period, 6))
    yield "samples between the old ones", imported(rig, columns, signals, **{"from": SHIFT * period})
    yield "without commands", imported(rig, columns, {name: signals[name] for name in CHANNELS})
