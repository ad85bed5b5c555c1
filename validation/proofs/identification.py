"""Identify cranes that are hidden in MuJoCo and judge new runs of them: how exact it is, and how often wrong.

    .venv/bin/python -m validation.proofs.identification            # 12 rigs, into identification.json
    .venv/bin/python -m validation.proofs.identification --rigs 2 --out two.json

Each rig has another size, from 1 to 30 times the laboratory rig's, and other numbers than those from which
the fit starts. All estimates are written before any true number is compared.
"""

import argparse
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.measured.identification import Identification, identify
from cranectl.measured.verdict import COVERED, Fit, judge
from cranectl.scenario import Scenario
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.settings import parse_settings
from cranectl.scenario.similarity import completed_rig, length_scale
from tests.measured.hidden import hidden_numbers, measured_run

SEED = 2611
LARGEST = 30.0  # times the laboratory rig
RUNS, CLEAN = 4, 4  # runs that are fitted, and unchanged ones that are judged
CLEAN_KIND = "unchanged"
DEAD_TIME = "effects.delay.seconds"
DATA = Path(__file__).with_name("identification.json")
ROPE = 1.4  # [m] of the laboratory rig
GUSTS = 0.5  # [m/s] on the laboratory rig
TILT = 0.003  # [rad]

Numbers = dict[str, float]
Change = Callable[[Scenario], Scenario]


def drawn_rig(rng: np.random.Generator) -> RigParameters:
    """Return a rig of another size, scaled from the laboratory rig."""
    size = float(np.exp(rng.uniform(0.0, np.log(LARGEST))))
    stated = {"rope_range": [0.1 * size, ROPE * size]}
    return parse_settings(RigParameters, completed_rig(stated), "a drawn rig")


def with_effects(**effects: Any) -> Change:
    """Return a change of a scenario's effects."""
    return lambda s: s.model_copy(update={"effects": s.effects.model_copy(update=effects)})


def changes(rig: RigParameters, numbers: Numbers, period: float) -> dict[str, tuple[Numbers, Change | None]]:
    """Return kinds of change: other numbers, and another crane."""
    size, effects = length_scale(rig.rope_range[1]), rig.effects
    offset, delay = "effects.installation.rope_offset", DEAD_TIME
    tilted = effects.installation.model_copy(update={"tilt": (TILT, TILT)})
    weak = effects.limits.model_copy(
        update={
            "velocity": (1e9,) * 3,
            "acceleration": (1e9,) * 3,
            "force": (*(0.25 * np.array(effects.limits.force[:2])).tolist(), 1.4 * rig.weight),
        }
    )
    return {
        "load + 20 %": ({**numbers, "load_mass": 1.2 * numbers["load_mass"]}, None),
        "drives 10 % slower": (
            {n: 1.1 * v if n.endswith("time_constant") else v for n, v in numbers.items()},
            None,
        ),
        "rope + 2 %": ({**numbers, offset: numbers[offset] + 0.02 * rig.rope_range[1]}, None),
        "dead time + 2 samples": ({**numbers, delay: numbers[delay] + 2.0 * period}, None),
        "elastic rope": (numbers, with_effects(rope=effects.rope.model_copy(update={"on_slack": "recover"}))),
        "load under its hook": (numbers, with_effects(body=effects.body)),
        "soft frame": (numbers, with_effects(frame=effects.frame)),
        "gusts": (numbers, with_effects(wind=effects.wind.model_copy(update={"gust": GUSTS * size**0.5}))),
        "rails 3 mrad off": (numbers, with_effects(installation=tilted)),
        "weak drives": (numbers, with_effects(limits=weak)),
    }


def main() -> None:
    """Identify, write, compare, judge."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rigs", type=int, default=12)
    parser.add_argument("--out", type=Path, default=DATA)
    arguments = parser.parse_args()
    rngs = [np.random.default_rng([SEED, k]) for k in range(arguments.rigs)]
    drawn = [(rig := drawn_rig(rng), hidden_numbers(rig, rng)) for rng in rngs]
    fits = []
    rigs: list[dict[str, Any]] = []
    for k, (rig, numbers) in enumerate(drawn):
        runs = [measured_run(rig, numbers, 1000 * k + seed, **timing_of(rig)) for seed in range(RUNS)]
        result = identify(runs, rig)
        fits.append(result)
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
    verdicts = []
    for k, ((rig, numbers), result) in enumerate(zip(drawn, fits, strict=True)):
        for kind, answer, statistic in judged(k, rig, numbers, result):
            verdicts.append([k, kind, answer, statistic])
            print(k, kind, answer, f"T = {statistic:.1f}", flush=True)
    data = {"seed": SEED, "rigs": rigs, "verdicts": verdicts}
    arguments.out.write_text(data_text(data), encoding="utf-8")
    print("\n".join(f"{name}: {value}" for name, value in summary(data).items()))


def timing_of(rig: RigParameters) -> dict[str, float]:
    """Return length and period of a rig's runs [s], which grow with the root of its size."""
    size = length_scale(rig.rope_range[1])
    return {"seconds": 15.0 * size**0.5, "period": round(5.0 * size**0.5) / 1000.0}


def judged(
    k: int, rig: RigParameters, numbers: Numbers, result: Identification
) -> Iterator[tuple[str, str, float]]:
    """Yield kind, answer and statistic of new runs of the k-th rig, unchanged ones first."""
    values, timing = {e.name: e.value for e in result.estimates}, timing_of(rig)
    fit = Fit(
        result.rig, result.replay, values, result.covariance, result.runs, result.converged, frozenset()
    )
    kinds: list[tuple[str, tuple[Numbers, Change | None]]] = [(CLEAN_KIND, (numbers, None))] * CLEAN
    kinds += changes(rig, numbers, timing["period"]).items()
    for n, (kind, (crane, change)) in enumerate(kinds):
        more = {} if change is None else {"change": change}
        run = measured_run(rig, crane, 1000 * k + 100 + n, **timing, **more)
        (verdict,) = judge({kind: run}, fit)
        yield kind, verdict.answer, verdict.statistic


def data_text(data: Mapping[str, Any]) -> str:
    """Return the results as JSON with a line for each rig and verdict, and six digits."""
    rounded = json.loads(json.dumps(data), parse_float=lambda text: float(f"{float(text):.6g}"))
    rigs, verdicts = (",\n  ".join(map(json.dumps, rounded[name])) for name in ("rigs", "verdicts"))
    return f'{{"seed": {SEED},\n "rigs": [\n  {rigs}],\n "verdicts": [\n  {verdicts}]}}\n'


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
    return words


if __name__ == "__main__":
    main()
