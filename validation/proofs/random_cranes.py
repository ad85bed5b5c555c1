"""Compare all plants with each other on random cranes, paths, effects, controllers and drives.

    python validation/proofs/random_cranes.py                      50 cases; the seed is the commit
    python validation/proofs/random_cranes.py --seed 3f2a91c --cases 200 --plants elastic,mujoco,drake
    python validation/proofs/random_cranes.py --rigid              rigid cranes of any size, default steps

A case runs on each plant that can simulate it. The exit code is 1 if plants differ by more than their limits,
unless shorter steps prove that the steps cause the difference. With --rigid only a loop that amplifies a
change of its start is an excuse. The same seed gives the same cases.
"""

import argparse
import itertools
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.cases import Pairwise
from cranectl.cases.case import Case
from cranectl.cases.validation import Validation
from cranectl.cases.workers import run_cases
from cranectl.cli.counts import Count
from cranectl.cli.output import Screen
from cranectl.compare.agreement import Agreement, AgreementLimits, judge, pair_limits
from cranectl.compare.runs import compare_runs
from cranectl.controllers.registry import controller_names
from cranectl.planning import load_scenario
from cranectl.plants import PLANTS
from cranectl.plants.plant import DRIVES, Drive
from cranectl.plants.steps import PhysicsStep, longest_agreeing_step
from cranectl.report.run.differences import DifferenceTables
from cranectl.scenario import Scenario
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.run_settings import ControlSettings
from cranectl.simulate import Plan, simulate_run
from cranectl.support.errors import InputError

EFFECTS = ("rope", "body", "wind", "frame", "friction", "sensing", "delay", "installation")
EFFECT_PROBABILITY = 0.3  # that a case has an effect, for each effect separately
RIGID_STEPS = 20_000  # of the longest motion of a rigid crane
MOVED, ALLOWED_GAIN = 1e-6, 10.0  # [m] at the start of a run, and how much of it a stable loop leaves later
FINER = 8  # times as many steps, to prove that steps cause a difference
ALLOWED_REMAINDER = 2.0  # of a difference with these steps, over what its order predicts
ROOT = Path(__file__).resolve().parents[2]


def commit() -> str:
    """Return the first digits of the commit's hash, or "0" outside of a repository."""
    command = ["git", "rev-parse", "--short=7", "HEAD"]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return process.stdout.strip() or "0"


def random_cases(seed: str, plants: Sequence[str], effects: Sequence[str] = EFFECTS) -> Iterator[Case]:
    """Yield an endless sequence of cases, on those of `plants` that can simulate them."""
    k = 0
    while True:
        random = np.random.default_rng([int(seed, 16), k])
        k += 1
        drive, controller = str(random.choice([*DRIVES])), str(random.choice(controller_names()))
        overrides = [f"name='random-{k}'", *_overrides(random, drive, effects)]
        try:  # a path may leave the rig, or a rope may be too stiff for the step
            scenario = load_scenario("fixed-position", overrides=overrides)
            suited = [plant for plant in plants if _can_run(plant, scenario, drive)]
            if len(suited) > 1:
                yield Case.of(
                    scenario, controller=controller, drive=drive, plants=suited, keep="none", pairwise=True
                )
        except InputError:
            continue


def random_rigs(seed: str, plants: Sequence[str], *, steps: int = RIGID_STEPS) -> Iterator[Case]:
    """Yield an endless sequence of rigid cranes of any size, mass and drive, with default physics steps.

    The motion lasts some periods of the pendulum, but at most `steps` physics steps.
    """
    for k in itertools.count():
        random = np.random.default_rng([int(seed, 16), 1, k])
        drive, controller = str(random.choice([*DRIVES])), str(random.choice(controller_names()))
        try:  # a path may leave the rig, and a controller may be unstable when sampled
            yield Case.of(
                _random_rig(random, drive, f"rigid-{k + 1}", steps),
                controller=controller,
                drive=drive,
                plants=plants,
                keep="none",
                pairwise=True,
            )
        except InputError:
            continue


def _random_rig(random: np.random.Generator, drive: Drive, name: str, steps: int) -> Scenario:
    """Return a scenario whose crane is drawn over the whole range of cranes, with a motion that fits it."""

    def draw(low: float, high: float) -> float:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    longest, gravity, load = draw(0.05, 1e3), draw(1.0, 30.0), draw(1e-3, 1e6)
    # Up to a load of 50 times the trolley, the largest that similar cranes may have.
    trolley = load / draw(1e-2, 50.0)
    width = [float(longest * random.uniform(1.0, 3.0)) for _ in range(2)]
    rig = {
        "gravity": gravity,
        "rope_range": [float(longest * random.uniform(0.03, 0.3)), longest],
        "bridge_range": [0.0, width[0]],
        "trolley_range": [0.0, width[1]],
        "load_mass": load,
        "rated_load": load,
        "trolley_mass": trolley,
        "bridge_mass": trolley * draw(0.1, 10.0),
        "winch_mass": load * draw(1e-2, 3.0),
        **{f"{axis}_time_constant": draw(1e-3, 0.5) for axis in ("bridge", "trolley", "winch")},
    }
    step = ControlSettings(period=0.001).default_step(
        longest_agreeing_step(RigParameters.from_table(rig, name), drive)
    )
    lasting = min(random.uniform(1.0, 4.0) * np.sqrt(longest / gravity), 0.8 * steps * step)
    start = np.array([*(share * side for share, side in zip((0.5, 0.5), width, strict=True)), -0.6 * longest])
    way = random.normal(size=3)
    # A polynomial of degree 9 that covers d in the time t accelerates by up to 9.4 d / t².
    way *= min(random.uniform(0.02, 0.25) * gravity * lasting**2 / 9.4, 0.2 * longest) / np.linalg.norm(way)
    duration = round(max(lasting, 0.1), 3)
    offset = random.uniform(-0.03, 0.03, 3) * longest
    overrides = [f"rig.{key}={value}" for key, value in rig.items()]
    overrides += [
        f"name='{name}'",
        f"duration={round(1.25 * duration, 3)}",
        "disturbances=[]",
        f"reference.start={start.tolist()}",
        f"reference.segments=[{{kind='line', to={(start + way).tolist()}, duration={duration}}}]",
        f"initial.load_offset={offset.tolist()}",
    ]
    return load_scenario("fixed-position", overrides=overrides)


def is_amplified(case: Case) -> bool:
    """Return True if the loop of a case amplifies a change of its start, as an unstable one does."""
    x, y, z = case.scenario.initial.load_offset
    moved = case.scenario.initial.model_copy(update={"load_offset": (x + MOVED, y, z)})
    a, b = (
        simulate_run(scenario, plant=case.plants[-1], drive=case.drive, controller=case.controller)
        for scenario in (case.scenario, case.scenario.model_copy(update={"initial": moved}))
    )
    return compare_runs(a, b, signals=()).max_load_error_m > ALLOWED_GAIN * MOVED


def _can_run(plant: str, scenario: Scenario, drive: str) -> bool:
    try:
        PLANTS.entry(plant).check_effects(scenario.effects, drive)
    except InputError:
        return False
    PLANTS.make(plant, scenario, drive).check_length(Plan.of(scenario).shortest_rope)
    return True


def _overrides(random: np.random.Generator, drive: str, effects: Sequence[str]) -> list[str]:
    def vary(value: Any) -> Any:
        """Draw a value between half and double of the given one."""
        return (np.array(value) * np.exp(random.uniform(-0.7, 0.7, np.shape(value)))).tolist()

    def draw_point() -> list[float]:
        return random.uniform([0.4, 0.3, -1.1], [1.6, 1.2, -0.5]).tolist()

    lines = [f"{{kind='line', to={draw_point()}, duration={random.uniform(2.5, 4.0)}}}" for _ in range(2)]
    pulses = [
        f"{{joint='{joint}', start={start}, end={start + 1}, magnitude={random.uniform(-1.0, 1.0)}}}"
        for start, joint in ((1, "alpha"), (4, "beta"))
    ]
    masses = {"bridge_mass": 6.0, "trolley_mass": 2.5, "winch_mass": 0.4, "load_mass": 1.0, "rated_load": 3.0}
    lags = dict.fromkeys(("bridge_time_constant", "trolley_time_constant", "winch_time_constant"), 0.02)
    overrides = [f"rig.{name}={vary(value)}" for name, value in {**masses, **lags}.items()]
    overrides += [
        "duration=8",
        "control.physics_step=0.0005",
        f"reference.start={draw_point()}",
        f"reference.segments=[{', '.join(lines)}]",
    ]
    overrides += [f"disturbances=[{', '.join(pulses)}]", "workspace.on_exit='record'"]
    overrides += [f"initial.load_offset={random.uniform(-0.03, 0.03, 3).tolist()}"]
    defaults = load_scenario("fixed-position").rig.effects
    for name in effects:
        if random.random() > EFFECT_PROBABILITY:
            continue
        for setting, value in getattr(defaults, name).model_dump().items():
            if name == "friction" and drive == "ideal" and setting in ("coulomb", "viscous"):
                overrides.append(f"effects.friction.{setting}=[0.0, 0.0, 0.0]")
            elif name == "delay":
                overrides.append(f"effects.delay.seconds={0.001 * random.integers(1, 8)}")
            elif setting == "seed":
                overrides.append(f"effects.{name}.seed={random.integers(1000)}")
            elif setting == "tilt":
                overrides.append(f"effects.installation.tilt={random.uniform(-0.01, 0.01, 2).tolist()}")
            elif setting in ("drive_gain", "rope_offset"):  # keep the default
                continue
            elif not isinstance(value, str):
                overrides.append(f"effects.{name}.{setting}={vary(value)}")
    return overrides


def is_step_error(case: Case, agreement: Agreement) -> bool:
    """Return True if the difference of two plants vanishes with the step, at the order of their limits.

    An unstable loop amplifies without bound what the steps leave, so no fixed limit holds there. A difference
    of the models stays, however short the steps are.
    """
    plants = agreement.plant, agreement.reference
    finer = PhysicsStep(case.scenario, case.drive).refined(FINER)
    limits = pair_limits(case.scenario, case.drive, plants)
    if finer is None or not isinstance(limits, AgreementLimits):
        return False
    a, b = (
        simulate_run(finer, plant=plant, drive=case.drive, controller=case.controller) for plant in plants
    )
    remainder = judge(a, b, limits=limits).excess / agreement.excess
    ends_agree = a.status == b.status and a.end_ns == b.end_ns
    return ends_agree and remainder <= ALLOWED_REMAINDER * FINER**-limits.order


def main() -> int:
    """Run random cases and print the differences of plants; return 1 if models or results differ."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cases", type=int, default=50)
    parser.add_argument("--seed", default=commit(), help="hexadecimal digits; by default the commit's")
    parser.add_argument("--plants", default="analytic,elastic,mujoco")
    parser.add_argument("--rigid", action="store_true", help="rigid cranes of any size, with default steps")
    options = parser.parse_args()
    screen = Screen()
    screen.print(f"{options.cases} random cases, seed {options.seed}")
    draw = random_rigs if options.rigid else random_cases
    generator = draw(options.seed, PLANTS.to_run(options.plants.split(",")))
    cases = tuple(itertools.islice(generator, options.cases))
    validation = Validation(cases, run_cases(cases, jobs=Count.available_cores()), {}, ())
    for table in DifferenceTables.pairs(Pairwise.of(validation)):
        screen.print(table)
    failed, excuse = 0, "an unstable loop" if options.rigid else "it vanishes with the step"
    for case, result in validation.results:
        for pair in result.pairs:
            agreement = pair.agreement
            if agreement.passed is False:
                from_steps = is_amplified(case) if options.rigid else is_step_error(case, agreement)
                failed += not from_steps
                screen.print(
                    f"{case.scenario.name}, {agreement.controller}, {agreement.drive}, "
                    f"{', '.join(case.scenario.effects.names) or 'no effects'}: {agreement.plant} and "
                    f"{agreement.reference} differ by {agreement.max_load_error_m:.1e} m and "
                    f"{agreement.max_angle_error_rad:.1e} rad, limits {agreement.limit_m:.1e} and "
                    f"{agreement.limit_rad:.1e}{'; ' + excuse if from_steps else ''}"
                )
    failed += len(validation.cases) - len(validation.finished)
    for _, case, failure in validation.failures:
        screen.print(f"{case and case.scenario.name}: {failure.reason}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
