"""Identify cranes that are hidden in a simulator of its own, and judge new runs: how exact, how often wrong.

    .venv/bin/python -m validation.proofs.identification            # 12 rigs, into identification.json
    .venv/bin/python -m validation.proofs.identification --rigs 2 --imperfect 1 --out two.json

Each rig has another size, from 1 to 25 times the laboratory rig's, and other numbers than those from which
the fit starts. The simulator shares nothing with the models (tests/measured/simulator.py). Imperfect cranes
have what no model has: backlash, rails that give, and friction that depends on speed and direction. All
estimates are written before any true number is compared.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from cranectl.measured.fit import Fit, fit_path, fit_text, read_fit
from cranectl.measured.identification import Identification, identify
from cranectl.measured.verdict import (
    COVERED,
    NOT_COVERED,
    NOT_DECIDED,
    WITHIN_TOLERANCE,
    RunVerdict,
    answer_for,
    judge,
)
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.settings import parse_settings
from cranectl.scenario.similarity import completed_rig, length_scale
from cranectl.simulate import Run
from tests.measured.hidden import hidden_numbers
from tests.measured.simulator import NO_DEFECTS, Defects, hidden_run

SEED = 2912
LARGEST = 25.0  # times the laboratory rig
RUNS, CLEAN = 4, 4  # runs that are fitted, and unchanged ones that are judged
CLEAN_KIND = "unchanged"
DEAD_TIME = "effects.delay.seconds"
DATA = Path(__file__).with_name("identification.json")
ROPE = 1.4  # [m] of the laboratory rig
GUSTS = 0.5  # [m/s] on the laboratory rig
TILT = 0.003  # [rad]
START_SWING = 0.001  # [rad] of imperfect cranes
DECISIVE = 2.0  # times the tolerance, from which a true difference must be found

Numbers = dict[str, float]


def drawn_rig(rng: np.random.Generator) -> RigParameters:
    """Return a rig of another size, scaled from the laboratory rig."""
    size = float(np.exp(rng.uniform(0.0, np.log(LARGEST))))
    stated = {"rope_range": [0.1 * size, ROPE * size]}
    return parse_settings(RigParameters, completed_rig(stated), "a drawn rig")


def imperfect(rig: RigParameters) -> Defects:
    """Return what an imperfect crane of this size has and no model knows."""
    size = length_scale(rig.rope_range[1])
    return Defects(backlash=1e-4 * size, frame_hertz=10.0 / size**0.5, stribeck=0.2, uneven=0.1)


def changes(rig: RigParameters, numbers: Numbers, period: float) -> dict[str, tuple[Numbers, Defects]]:
    """Return kinds of change: other numbers, and what else the crane then has."""
    size = length_scale(rig.rope_range[1])
    offset, delay = "effects.installation.rope_offset", DEAD_TIME
    return {
        "load + 20 %": ({**numbers, "load_mass": 1.2 * numbers["load_mass"]}, NO_DEFECTS),
        "drives 10 % slower": (
            {n: 1.1 * v if n.endswith("time_constant") else v for n, v in numbers.items()},
            NO_DEFECTS,
        ),
        "rope + 2 %": ({**numbers, offset: numbers[offset] + 0.02 * rig.rope_range[1]}, NO_DEFECTS),
        "dead time + 2 samples": ({**numbers, delay: numbers[delay] + 2.0 * period}, NO_DEFECTS),
        "elastic rope": (numbers, Defects(rope_stiffness=5000.0 * rig.load_mass)),
        "load under its hook": (numbers, Defects(hook_length=0.1 * size)),
        "soft frame": (numbers, Defects(frame_hertz=9.0 / size**0.5)),
        "gusts": (numbers, Defects(gust=GUSTS * size**0.5)),
        "rails 3 mrad off": (numbers, Defects(tilt=(TILT, TILT))),
        "weak drives": (numbers, Defects(force_limit=0.25)),
    }


def joined(one: Defects, other: Defects) -> Defects:
    """Return the defects of both."""
    return replace(one, **{name: getattr(other, name) for name in other.names})


def main() -> None:
    """Identify, write, compare, judge."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rigs", type=int, default=12)
    parser.add_argument("--imperfect", type=int, default=12, help="of these, tried with errors of the model")
    parser.add_argument("--out", type=Path, default=DATA)
    arguments = parser.parse_args()
    rngs = [np.random.default_rng([SEED, k]) for k in range(arguments.rigs)]
    drawn = [(rig := drawn_rig(rng), hidden_numbers(rig, rng)) for rng in rngs]
    fits = []
    rigs: list[dict[str, Any]] = []
    for k, (rig, numbers) in enumerate(drawn):
        runs = [hidden_run(rig, numbers, 1000 * k + seed, **timing_of(rig))[0] for seed in range(RUNS)]
        result = identify(runs, rig)
        fits.append(fit_of(result, runs))
        rigs.append(
            {
                "size": length_scale(rig.rope_range[1]),
                "misfit": result.misfit,
                "converged": result.converged,
                "estimates": {e.name: [e.value, e.half_width] for e in result.estimates},
            }
        )
        print(f"rig {k}: size {rigs[-1]['size']:.1f}, misfit {result.misfit:.3f}", flush=True)
    arguments.out.write_text(json.dumps({"seed": SEED, "rigs": rigs}, indent=1), encoding="utf-8")
    for row, (_, numbers) in zip(rigs, drawn, strict=True):
        row["true"] = {name: numbers[name] for name in row["estimates"]}
    data: dict[str, Any] = {"seed": SEED, "rigs": rigs, "verdicts": [], "tolerances": []}
    for k, ((rig, numbers), fit) in enumerate(zip(drawn, fits, strict=True)):
        for kind, verdict, _ in judged(k, rig, numbers, fit):
            data["verdicts"].append([k, kind, verdict.answer, verdict.statistic])
            print(k, kind, verdict.answer, f"T = {verdict.statistic:.1f}", flush=True)
    for k, (rig, numbers) in enumerate(drawn[: arguments.imperfect]):
        for row in with_tolerances(k, rig, numbers):
            data["tolerances"].append(row)
            print(*row, flush=True)
    arguments.out.write_text(data_text(data), encoding="utf-8")
    print("\n".join(f"{name}: {value}" for name, value in summary(data).items()))


def fit_of(result: Identification, runs: Sequence[Run]) -> Fit:
    """Return an identification as verdicts read it from its file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "rig.toml"
        path.write_text('extends = "lab-rig"\n')
        fit_path(path).write_text(fit_text(result, runs))
        return replace(read_fit(path), rig=result.rig)


def timing_of(rig: RigParameters) -> dict[str, float]:
    """Return length and period of a rig's runs [s], which grow with the root of its size."""
    size = length_scale(rig.rope_range[1])
    return {"seconds": 15.0 * size**0.5, "period": round(5.0 * size**0.5) / 1000.0}


def judged(
    k: int,
    rig: RigParameters,
    numbers: Numbers,
    fit: Fit,
    *,
    has: Defects = NO_DEFECTS,
    swing: float = 0.0,
) -> Iterator[tuple[str, RunVerdict, float]]:
    """Yield kind, verdict and true error [m] of new runs of the k-th rig, unchanged ones first.

    The true error is that of the predicted load at any sample, as sensors without error would show it.
    """
    timing = timing_of(rig)
    kinds: list[tuple[str, tuple[Numbers, Defects]]] = [(CLEAN_KIND, (numbers, NO_DEFECTS))] * CLEAN
    kinds += changes(rig, numbers, timing["period"]).items()
    for n, (kind, (crane, change)) in enumerate(kinds):
        run, truth = hidden_run(
            rig, crane, 1000 * k + 100 + n, **timing, swing=swing, defects=joined(has, change)
        )
        (verdict,) = judge({kind: run}, fit)
        error = np.linalg.norm(truth.sensed - verdict.load.predicted, axis=1)
        yield kind, verdict, float(np.nan_to_num(error, nan=np.inf).max())


def with_tolerances(k: int, rig: RigParameters, numbers: Numbers) -> Iterator[list[Any]]:
    """Yield rig, kind, answer, and true error, tolerance and band [m] of new runs of an imperfect crane.

    The tolerance is the largest true error of the unchanged runs, and two bands.
    """
    has = imperfect(rig)
    runs = [
        hidden_run(rig, numbers, 1000 * k + seed, **timing_of(rig), swing=START_SWING, defects=has)[0]
        for seed in range(RUNS)
    ]
    fit = fit_of(identify(runs, rig), runs)
    rows = [*judged(k, rig, numbers, fit, has=has, swing=START_SWING)]
    tolerance = max(error + 2.0 * v.band for kind, v, error in rows if kind == CLEAN_KIND)
    for kind, verdict, error in rows:
        answer = verdict.answer if verdict.reason else answer_for(verdict, tolerance)[0]
        yield [k, kind, answer, error if np.isfinite(error) else None, tolerance, verdict.band]


def data_text(data: Mapping[str, Any]) -> str:
    """Return the results as JSON with a line for each rig and verdict, and six digits."""
    rounded = json.loads(json.dumps(data), parse_float=lambda text: float(f"{float(text):.6g}"))
    parts = (
        f' "{name}": [\n  {rows}]'
        for name in ("rigs", "verdicts", "tolerances")
        for rows in [",\n  ".join(map(json.dumps, rounded[name]))]
    )
    return f'{{"seed": {SEED},\n' + ",\n".join(parts) + "}\n"


def summary(data: Mapping[str, Any]) -> dict[str, str]:
    """Return in words how exact the numbers are, and how often the verdicts err."""
    inside: list[bool] = []
    worst: dict[str, float] = {}
    late = 0.0
    for rig in data["rigs"]:
        for name, (value, half_width) in rig["estimates"].items():
            true = rig["true"][name]
            inside.append(abs(value - true) <= half_width)
            worst[name] = max(worst.get(name, 0.0), abs(value - true) / abs(true))
            if name == DEAD_TIME:
                late = max(late, abs(value - true) / rig["size"] ** 0.5)
    converged = sum(rig["converged"] for rig in data["rigs"])
    words = {
        "converged": f"{converged} of {len(data['rigs'])}",
        "numbers inside their intervals": f"{sum(inside)} of {len(inside)}",
    }
    words |= {f"largest error of {name}": f"{100.0 * error:.2f} %" for name, error in worst.items()}
    words["largest error of the dead time"] = f"{1e6 * late:.0f} µs, over the root of the size"
    kinds: dict[str, list[bool]] = {}
    for _, kind, answer, _ in data["verdicts"]:
        kinds.setdefault(kind, []).append(answer != COVERED)
    words |= {
        f"not covered, {kind}": f"{sum(not_covered)} of {len(not_covered)}"
        for kind, not_covered in kinds.items()
    }
    return words | tolerance_summary(data["tolerances"])


def tolerance_summary(rows: Sequence[Sequence[Any]]) -> dict[str, str]:
    """Return in words how often answers with a tolerance are right, of imperfect cranes."""
    clean = [row for row in rows if row[1] == CLEAN_KIND]
    error = {id(row): np.inf if row[3] is None else row[3] for row in rows}
    decisive = [row for row in rows if row[1] != CLEAN_KIND and error[id(row)] > DECISIVE * row[4]]
    good = [row for row in rows if row[2] in (COVERED, WITHIN_TOLERANCE)]
    return {
        "imperfect cranes": str(len({row[0] for row in rows})),
        "unchanged and within": f"{sum(row in good for row in clean)} of {len(clean)}",
        "changed by twice the tolerance and not covered": (
            f"{sum(row[2] == NOT_COVERED for row in decisive)} of {len(decisive)}"
        ),
        "false within": str(sum(error[id(row)] > row[4] for row in good if row[2] == WITHIN_TOLERANCE)),
        "false covered": str(
            sum(error[id(row)] > 2.0 * row[5] for row in rows if row[2] == COVERED and row[1] != CLEAN_KIND)
        ),
        "not decided": f"{sum(row[2] == NOT_DECIDED for row in rows)} of {len(rows)}",
    }


if __name__ == "__main__":
    main()
