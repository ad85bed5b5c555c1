"""Cranes that are hidden for the proof of verdicts: their sizes, numbers and flaws, and changes of them."""

from dataclasses import replace
from math import hypot, log, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cranectl.scenario.load import RigFile
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from tests.tools.measured.hidden import hidden_numbers
from tests.tools.measured.simulator import NO_DEFECTS, Defects, Truth, hidden_run

CRANES = 12
LARGEST = 25.0  # times the laboratory rig
ROPE = 1.4  # [m] of the laboratory rig
PERIOD = 0.005  # [s] of a log and of set-points, on the laboratory rig
SECONDS = 15.0  # of a run, on the laboratory rig
FLAWS = 4  # that an imperfect crane has
UNCHANGED = "unchanged"
DEAD_TIME, ROPE_ZERO = "effects.delay.seconds", "effects.installation.rope_offset"

Numbers = dict[str, float]


class Crane(NamedTuple):
    """A hidden crane; lengths grow with its size, and times with the root of it."""

    size: float  # times the laboratory rig
    numbers: Numbers
    flaws: Defects
    holds: bool  # whether its set-points change as often as a slow log has rows, and not more often

    @property
    def slower(self) -> float:
        """Times by which all is slower than on the laboratory rig."""
        return sqrt(self.size)

    def rig(self, folder: Path) -> RigParameters:
        """Return what its owner states of it, from a file that is written into `folder`."""
        return RigFile.load(str(self.rig_file(folder, "rig")))

    def rig_file(self, folder: Path, name: str) -> Path:
        """Write the file of what its owner states of it."""
        path = folder / f"{name}.toml"
        path.write_text(f"rope_range = [{0.1 * self.size}, {ROPE * self.size}]\n", encoding="utf-8")
        return path

    def period(self, of_laboratory: float = PERIOD) -> float:
        """Return the period of a log, to whole milliseconds [s]."""
        return round(1e3 * of_laboratory * self.slower) / 1e3

    def run(
        self,
        rig: RigParameters,
        seed: int,
        *,
        changed: tuple[Numbers, Defects] | None = None,
        period: float = PERIOD,
        seconds: float = SECONDS,
        **more: Any,
    ) -> tuple[Run, Truth]:
        """Return a run, of an exact crane unless it is `changed`; `period` and `seconds` on a small rig."""
        numbers, defects = changed or (self.numbers, NO_DEFECTS)
        pace = None if self.holds or period == PERIOD else self.period()
        return hidden_run(
            rig, numbers, seed, seconds=seconds * self.slower, period=self.period(period),
            set_point_period=pace, defects=defects, **more,
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        flaws = {name: getattr(self.flaws, name) for name in self.flaws.names}
        return {"size": self.size, "numbers": self.numbers, "flaws": flaws, "holds": self.holds}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Crane":
        """Return the crane of plain data."""
        flaws = {n: tuple(v) if isinstance(v, list) else v for n, v in data["flaws"].items()}
        return cls(data["size"], data["numbers"], Defects(**flaws), data["holds"])


def drawn_crane(seed: int, k: int, folder: Path) -> Crane:
    """Return the k-th hidden crane."""
    rng = np.random.default_rng([seed, k])
    size = float(np.exp(rng.uniform(0.0, log(LARGEST))))
    unknown = Crane(size, {}, NO_DEFECTS, holds=k % 2 == 0)
    rig = unknown.rig(folder)
    numbers = {name: float(value) for name, value in hidden_numbers(rig, rng).items()}
    return unknown._replace(numbers=numbers, flaws=drawn_flaws(rig, rng))


def drawn_flaws(rig: RigParameters, rng: np.random.Generator) -> Defects:
    """Return some of the flaws that real cranes and their logs have, each over a wide range."""
    size = rig.length_scale
    slower = sqrt(size)

    def between(low: float, high: float) -> float:
        """Return a number whose logarithm is even."""
        return float(np.exp(rng.uniform(log(low), log(high))))

    def either(largest: float) -> float:
        return float(rng.choice([-1.0, 1.0]) * between(0.2 * largest, largest))

    stiffness = 5e3 * rig.load_mass
    kinds: list[dict[str, Any]] = [
        {"backlash": between(5e-5, 1e-3) * size},
        {"frame_hertz": between(6.0, 20.0) / slower, "frame_damping": between(0.01, 0.05)},
        {"hook_length": between(0.02, 0.1) * size, "hook_mass": between(0.05, 0.3)},
        {"rope_stiffness": between(1.0, 10.0) * stiffness, "rope_damping": between(0.05, 0.2)},
        {"gust": between(0.05, 0.4) * slower},
        {"stribeck": between(0.05, 0.5), "stribeck_speed": between(0.005, 0.05) * slower},
        {"uneven": either(0.3)},
        {"tilt": (either(0.002), either(0.002))},
        {"clock_drift": either(2e-4)},
        {"jitter": between(0.02, 0.2) * PERIOD * slower},
        {"angle_late": between(0.001, 0.01) * slower},
        {"angle_scale": 1.0 + either(0.02)},
        {"angle_twist": either(0.02)},
        {"rope_scale": 1.0 + either(0.005)},
        {"noisier": between(0.7, 1.4)},
    ]
    chosen = [kinds[k] for k in rng.choice(len(kinds), FLAWS, replace=False)]
    return Defects(**{name: value for flaw in chosen for name, value in flaw.items()})


def changes(crane: Crane, rig: RigParameters, has: Defects) -> dict[str, tuple[Numbers, Defects]]:
    """Return nine changes of a crane that `has` flaws, each with its numbers and its flaws."""
    numbers, size, late = crane.numbers, crane.size, 2.0 * crane.period()
    soft = 9.0 / crane.slower
    stiffness = 5e3 * rig.load_mass
    slower = {n: 1.1 * v if n.endswith("time_constant") else v for n, v in numbers.items()}
    return {
        "load + 20 %": ({**numbers, "load_mass": 1.2 * numbers["load_mass"]}, has),
        "drives 10 % slower": (slower, has),
        "rope + 2 %": ({**numbers, ROPE_ZERO: numbers[ROPE_ZERO] + 0.02 * rig.rope_range[1]}, has),
        "dead time + 2 samples": ({**numbers, DEAD_TIME: numbers[DEAD_TIME] + late}, has),
        "elastic rope": (
            numbers,
            replace(has, rope_stiffness=min(has.rope_stiffness or stiffness, stiffness)),
        ),
        "load under its hook": (numbers, replace(has, hook_length=has.hook_length + 0.1 * size)),
        "soft frame": (numbers, replace(has, frame_hertz=min(has.frame_hertz or soft, soft))),
        "gusts": (numbers, replace(has, gust=hypot(has.gust, 0.5 * crane.slower))),
        "rails 3 mrad off": (numbers, replace(has, tilt=(has.tilt[0] + 0.003, has.tilt[1] + 0.003))),
    }
