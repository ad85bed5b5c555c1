"""Measured runs of hidden cranes: what encoders of a crane in MuJoCo read as its axes move."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv
from scipy.interpolate import CubicHermiteSpline

from cranectl.scenario import Scenario
from cranectl.scenario.load import RigFile
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.tools.measured.experiment import CHANNELS, encoders_of
from cranectl.tools.measured.importing import import_files
from cranectl.tools.measured.mapping import MeasuredMap
from cranectl.tools.measured.replay import crane_scenario, simulate_replay
from cranectl.tools.measured.unknowns import rig_with, unknowns_of

LAB = RigFile.load("lab-rig")
MAX_FALL = 0.5  # of gravity: how fast the rope is let go when its speed jumps, on a winch with usual lag
COMMANDS = ("bridge_command", "trolley_command", "rope_command")


def with_effects(owner: Any, **effects: object) -> Any:
    """Return a rig or a scenario with other effects."""
    return owner.model_copy(update={"effects": owner.effects.model_copy(update=effects)})


def with_sensing(**sensing: object) -> RigParameters:
    """Return the laboratory's rig with other encoders."""
    changed: RigParameters = with_effects(LAB, sensing=LAB.effects.sensing.model_copy(update=sensing))
    return changed


def with_signal(run: Run, name: str, values: Array) -> Run:
    """Return a run with other readings (N,) of a signal."""
    table = run.table.copy()
    table[:, next(k for k, column in enumerate(table.T) if (column == run.signal(name)).all())] = values
    return replace(run, table=table)


def hidden_numbers(rig: RigParameters, rng: np.random.Generator) -> dict[str, float]:
    """Numbers of a crane that differ from those of `rig` by up to 40 %, its gains by up to 3 %."""
    return {
        unknown.name: unknown.scale * rng.uniform(-0.7, 0.7)
        if unknown.name.endswith("rope_offset")
        else unknown.start * rng.uniform(0.97, 1.03)
        if "gain" in unknown.name
        else unknown.start * rng.uniform(0.6, 1.4)
        for unknown in unknowns_of(rig, "commands")
    }


NUMBERS = hidden_numbers(LAB, np.random.default_rng(5))


def set_points(
    rig: RigParameters, rng: np.random.Generator, time: Array, axes: tuple[int, ...]
) -> tuple[Array, Array]:
    """Where the axes start, and trapezoids of speed in turn forth and back with pauses, shape (N, 3).

    Speeds of the rope that are held for long rise slowly, since a jump of the winch would make it slack.
    """
    period, winch = time[1] - time[0], rig.gravity * rig.winch_time_constant
    limits, swing = rig.effects.limits, 2.0 * np.pi * np.sqrt(0.5 * rig.rope_range[1] / rig.gravity)
    start, speeds = np.array([np.mean(ends) for ends in rig.workspace]), np.zeros((len(time), 3))
    for axis in axes:
        begin, direction = 0.3 * swing * rng.uniform(0.5, 1.5), rng.choice([-1.0, 1.0])
        low, high = rig.workspace[axis]
        while begin < time[-1] - 2.0 * swing:
            speed = rng.uniform(0.2, 0.6) * limits.velocity[axis]
            ramp = speed / (rng.uniform(0.3, 0.8) * limits.acceleration[axis])
            if axis == 2:
                ramp = max(ramp, speed * period / (MAX_FALL * winch))
            length = min(rng.uniform(0.3, 1.0) * swing, 0.3 * (high - low) / speed)
            since = time - begin
            shape = np.clip(np.minimum(since / ramp, (length + ramp - since) / ramp), 0.0, 1.0)
            speeds[:, axis] += direction * speed * shape
            begin += length + ramp + rng.uniform(0.1, 0.6) * swing
            direction = -direction
    return start, speeds


def measured_run(
    nominal: RigParameters,
    numbers: dict[str, float],
    seed: int,
    *,
    seconds: float = 10.0,
    period: float = 0.005,
    axes: tuple[int, ...] = (0, 1, 2),
    sticks: bool = False,
    motion: tuple[Array, Array] | None = None,
    change: Callable[[Scenario], Scenario] = lambda scenario: scenario,
) -> Run:
    """What a measuring system writes of the crane with `numbers`, described by `nominal`.

    The drives get random set-points for so many `seconds`, or a `motion`: start (3,) and speeds (N, 3).
    A load that `sticks` rests off the vertical, as far as friction of the pivot can hold it.
    """
    rng, true = np.random.default_rng(seed), rig_with(nominal, numbers)
    time = period * np.arange(round(seconds / period) + 1 if motion is None else len(motion[1]))
    start, speeds = motion or set_points(nominal, rng, time, axes)
    still = np.zeros((len(time), len(CHANNELS)))
    still[:, :3] = start
    run = run_of(nominal, time, still, speeds)
    installation = true.effects.installation
    state = np.zeros(10)
    state[0:6:2] = start - [0.0, 0.0, installation.rope_offset]
    if sticks:
        friction = true.effects.friction.pivot_coulomb / (true.load_mass * true.gravity * state[4])
        state[6::2] = 0.9 * friction * np.random.default_rng(seed).uniform(-1.0, 1.0, 2)
    whole, late = divmod(true.effects.delay.seconds, period)
    arriving = speeds[(np.arange(len(time)) - int(whole)).clip(min=0)] * installation.drive_gain
    simulated = simulate_replay(
        run, "mujoco", "commands",
        scenario=change(crane_scenario(run.scenario, true, "commands")), commands=arriving, initial=state,
    )  # fmt: skip
    assert len(simulated.time_ns) == len(time), simulated.status
    rows = simulated.block("state")
    readings = CubicHermiteSpline(time, rows[:, 0::2], rows[:, 1::2])((time - late).clip(min=0.0))
    readings[:, 2] += installation.rope_offset
    readings[:, 3:] += rng.uniform(-0.002, 0.002, 2)  # zeros of the sensors
    steps, noise = encoders_of(nominal)
    readings += noise * rng.standard_normal(readings.shape)
    return run_of(nominal, time, np.round(readings / steps) * steps, speeds)


def run_of(rig: RigParameters, time: Array, readings: Array, speeds: Array) -> Run:
    """The run that an import of these columns gives."""
    columns = dict(zip((*CHANNELS, *COMMANDS), np.hstack([readings, speeds]).T, strict=True))
    return imported(rig, {"t": time, **columns}, signals_of(columns))


def signals_of(columns: Mapping[str, Array]) -> dict[str, dict[str, Any]]:
    """Return the tables of a map for columns in SI units that have the names of their signals."""
    units = dict.fromkeys(CHANNELS, "m") | {"alpha": "rad", "beta": "rad"} | dict.fromkeys(COMMANDS, "m/s")
    return {name: {"column": name, "unit": units[name]} for name in columns}


def imported(
    rig: RigParameters,
    columns: Mapping[str, Array],
    signals: Mapping[str, Mapping[str, Any]],
    *,
    file: str = "run.csv",
    **settings: Any,
) -> Run:
    """The run of `rig` that an import of a file with these columns gives, by the map with these settings."""
    has_commands = COMMANDS[0] in signals
    stated = {"time": {"column": "t"}, "signals": signals, "check_physics": False, **settings}
    mapping = MeasuredMap.from_table(stated | ({"commands": "velocity"} if has_commands else {}), "the map")
    with TemporaryDirectory() as folder:
        path = Path(folder) / file
        csv.write_csv(pa.table(dict(columns)), path)  # text is read without another process
        run = import_files([path], mapping, directory=path.parent).run
    return replace(run, scenario=run.scenario.model_copy(update={"rig": rig}))
