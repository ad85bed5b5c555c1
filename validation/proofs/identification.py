"""Identify cranes that are hidden in MuJoCo and judge new runs of them: how exact it is, and how often wrong.

    .venv/bin/python -m validation.proofs.identification --rigs 12 --out identification.json

Each rig has another size, from 1 to 30 times the laboratory rig's, and other numbers than those from which
the fit starts. All estimates are written before any true number is compared.
"""

import argparse
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.measured.identification import identify
from cranectl.measured.verdict import COVERED, Fit, judge
from cranectl.scenario import Scenario
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.settings import parse_settings
from cranectl.scenario.similarity import completed_rig, length_scale
from tests.measured.hidden import hidden_numbers, measured_run

SEED = 1946
LARGEST = 30.0  # times the laboratory rig
RUNS, CLEAN = 4, 4  # runs that are fitted, and unchanged ones that are judged
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
    offset, delay = "effects.installation.rope_offset", "effects.delay.seconds"
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
    parser.add_argument("--out", type=Path, default=Path("identification.json"))
    arguments = parser.parse_args()
    rigs = [np.random.default_rng([SEED, k]) for k in range(arguments.rigs)]
    drawn = [(rig := drawn_rig(rng), hidden_numbers(rig, rng)) for rng in rigs]
    fits = []
    for k, (rig, numbers) in enumerate(drawn):
        size = length_scale(rig.rope_range[1])
        timing = {"seconds": 15.0 * size**0.5, "period": round(5.0 * size**0.5) / 1000.0}
        runs = [measured_run(rig, numbers, 1000 * k + seed, **timing) for seed in range(RUNS)]
        fits.append((identify(runs, rig), timing))
        print(f"rig {k}: size {size:.1f}, misfit {fits[-1][0].misfit:.3f}", flush=True)
    estimates = [[vars(e) for e in result.estimates] for result, _ in fits]
    arguments.out.write_text(json.dumps({"estimates": estimates}, indent=1))
    answers: list[dict[str, Any]] = []
    for k, ((rig, numbers), (result, timing)) in enumerate(zip(drawn, fits, strict=True)):
        values = {e.name: e.value for e in result.estimates}
        fit = Fit(
            result.rig, result.replay, values, result.covariance, result.runs, result.converged, frozenset()
        )
        judged: dict[str, tuple[Mapping[str, float], Change | None]] = {
            f"clean {n}": (numbers, None) for n in range(CLEAN)
        }
        judged |= changes(rig, numbers, timing["period"])
        for n, (name, (crane, change)) in enumerate(judged.items()):
            more = {} if change is None else {"change": change}
            try:
                run = measured_run(rig, dict(crane), 1000 * k + 100 + n, **timing, **more)
            except AssertionError as error:  # the changed crane cannot do the motion
                answers.append({"rig": k, "kind": name, "answer": f"stopped: {error}"})
                continue
            (verdict,) = judge({name: run}, fit)
            answers.append({"rig": k, "kind": name, **verdict.to_json()})
            print(k, name, verdict.answer, f"T = {verdict.statistic:.1f}", flush=True)
    report(drawn, fits, estimates, answers)
    arguments.out.write_text(json.dumps({"estimates": estimates, "answers": answers}, indent=1))


def report(drawn: Any, fits: Any, estimates: Any, answers: list[dict[str, Any]]) -> None:
    """Print errors of the numbers, coverage of the intervals, and shares of the answers."""
    inside, worst = [], {}
    for (_, numbers), rows in zip(drawn, estimates, strict=True):
        for row in rows:
            error = abs(row["value"] - numbers[row["name"]])
            inside.append(error <= row["half_width"])
            relative = error / abs(numbers[row["name"]])
            worst[row["name"]] = max(worst.get(row["name"], 0.0), relative)
    print(f"converged: {sum(result.converged for result, _ in fits)} of {len(fits)}")
    print(f"numbers inside their intervals: {100.0 * np.mean(inside):.1f} % of {len(inside)}")
    for name, error in worst.items():
        print(f"{name}: at most {100.0 * error:.3f} % off")
    for kind in dict.fromkeys(answer["kind"].partition(" ")[0] if answer["kind"].startswith("clean")
                              else answer["kind"] for answer in answers):  # fmt: skip
        of_kind = [a["answer"] for a in answers if a["kind"] == kind or a["kind"].startswith(kind + " ")]
        print(f"{kind}: {sum(a == COVERED for a in of_kind)} covered of {len(of_kind)}")


if __name__ == "__main__":
    main()
