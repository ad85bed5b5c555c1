"""What a command prints is accepted when it is typed back: rig lines, remedies, bounds, names and numbers.

The cases are generated over all shipped rigs, models, controllers and kinds of drives, and over numbers with
more digits than a screen shows. RANGE_CASES=all tries more of them.
"""

import json
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.cases import Case
from cranectl.cli.main import main
from cranectl.controllers.registry import controller_names
from cranectl.planning import load_scenario
from cranectl.plants import DRIVES
from cranectl.plants import PLANTS as ALL_PLANTS
from cranectl.scenario.effects import EffectNumbers
from cranectl.scenario.load import RigFile, scenario_names
from cranectl.support.errors import InputError
from cranectl.support.resources import Shipped
from cranectl.tools.robustness.certificate.conservatism import LargestValues
from cranectl.tools.robustness.certificate.operating_points import OperatingPoint
from cranectl.tools.robustness.report.tables import CertificateTables
from tests.cli.conftest import Command
from tests.ranges import ALL, ends

MANY = 400 if ALL else 25
MAX_REMEDIES = 8  # that are followed one after another
PLANTS = ("analytic", "elastic", "mujoco")
STILL = 'name = "still"\nduration = 0.05\nreference.start = [1.0, 0.77, -0.7]\n'

pytestmark = pytest.mark.usefixtures("in_empty_directory")


def rows(text: str) -> dict[str, str]:
    """Return the second cell of each row of a printed table, by its first cell."""
    return dict(re.findall(r"^ ([\w.]+) {2,}(\S.*?)(?: {2,}|$)", text, re.MULTILINE))


def as_toml(text: str) -> str:
    """Return a printed value as a file of settings has it."""
    return text if re.fullmatch(r"[\[\d.e, \]-]+|true|false", text) else json.dumps(text)


def random_rigs() -> list[tuple[str, str]]:
    """Return the shipped rigs and rigs of other sizes, whose further numbers are scaled."""
    rng, rigs = np.random.default_rng(1), [(name, name) for name in RigFile.names()]
    for k in range(40 if ALL else 6):
        load, rope = np.exp(rng.uniform(np.log((0.05, 0.4)), np.log((90_000.0, 60.0)))).tolist()
        rigs.append((f"random-{k}", f"rated_load = {load!r}\nrope_range = [{rope / 9.0!r}, {rope!r}]\n"))
    return rigs


@pytest.mark.parametrize(("name", "content"), random_rigs(), ids=lambda text: text.partition("\n")[0])
def test_a_rig_that_is_shown_can_be_written(name: str, content: str, output: Command) -> None:
    if name != content:
        Path(name := f"{name}.toml").write_text(content)
    shown = rows(output("info", name))
    numbers = {key: value for key, value in shown.items() if key != "number"}
    assert len(numbers) > 40
    Path("typed.toml").write_text("".join(f"{key} = {as_toml(value)}\n" for key, value in numbers.items()))
    typed, known = RigFile.load("typed.toml"), RigFile.load(name)
    for key in ("workspace", "time_constants", "driven_masses"):
        assert getattr(typed, key) == pytest.approx(getattr(known, key), rel=1e-5)
    start = (*known.workspace[:2].mean(axis=1).tolist(), -float(known.workspace[2].mean()))
    overrides = [f"reference.start={[*start]}", "disturbances=[]"]  # of which one is across a planar crane
    scenario = load_scenario("fixed-position", rig="typed.toml", overrides=overrides)
    for plant in PLANTS:
        ALL_PLANTS.make(plant, scenario, "velocity")


def models() -> list[tuple[str, str]]:
    """Return the shipped model, and models of cranes whose masses, gravity and drives have many digits."""
    text, rng = Shipped.MODEL_FILE.read_text(), np.random.default_rng(2)
    found = [("crane", text)]

    def scale(match: re.Match[str]) -> str:
        return f'{match[1]}="{float(match[2]) * float(np.exp(rng.uniform(-0.7, 0.7)))!r}"'

    numbers = re.compile(r'\b(mass|kv|armature)="([\d.e-]+)"')
    return [*found, *((f"random-{k}", numbers.sub(scale, text)) for k in range(20 if ALL else 4))]


@pytest.mark.parametrize(("name", "text"), models(), ids=lambda text: text[:9].strip("<!-\n "))
def test_the_rig_lines_of_a_model_run_it(name: str, text: str, output: Command) -> None:
    Path(f"{name}.xml").write_text(text)
    told = output("info", f"{name}.xml", "--as-is").partition("rig file")[2]
    lines = [line.strip() for line in told.splitlines()[1:] if " = " in line or "[plant" in line]
    assert len(lines) >= 9
    Path("rig.toml").write_text("\n".join(lines) + "\n")
    Path("still.toml").write_text(STILL)
    options = f"--rig rig.toml --plants analytic,{name}.xml --drive velocity --controller lqr"
    assert main(["run", "still.toml", *options.split(), "--out", "new.mcap"]) == 0


def test_names_that_are_listed_are_accepted(output: Command) -> None:
    """The list on the screen has no fewer than the registries."""
    shown = dict(re.findall(r"^ ?([\w+-]+) {2,}(\S.*?)(?: {2,}|$)", output("list"), re.MULTILINE))
    assert {*scenario_names(), *controller_names()} <= shown.keys()
    assert shown["rigs"].split(", ") == RigFile.names()
    assert shown["drives"].split(", ") == list(DRIVES)
    for name in (*shown["rigs"].split(", "), *scenario_names()):
        assert name in output("info", name)
    Path("still.toml").write_text(STILL)
    for name in shown["drives"].split(", "):
        assert (
            main(["run", "still.toml", "--drive", name, "--plants", "analytic", "--controller", "lqr"]) == 0
        )


def typed(remedy: str) -> tuple[list[str], str, list[str]]:
    """Return assignments, drive and plants of the first alternative that a remedy gives to be typed."""
    for part in re.split(r"; |, or (?=add|set|take|raise|choose|leave|change)", remedy):
        sets = [shlex.split(word)[0] for word in re.findall(r"--set ('[^']*'|\S+?)(?=[,.;]?(?:\s|$))", part)]
        number = r"-?[\d.]*\d(?:e[+-]?\d+)?"
        sets += [f"{key}={value}" for key, value in re.findall(rf"set ([a-z][\w.]*) to ({number})", part)]
        value = rf"\[[^\]]*\]|\{{[^}}]*\}}|{number}"
        sets += [f"{key}={text}" for key, text in re.findall(rf"set ([a-z][\w.]*) ?= ?({value})", part)]
        drive, plants = re.search(r"--drive (\w+)", part), re.search(r"--plants ([\w,]+)", part)
        if sets or drive or plants:
            return sets, drive[1] if drive else "", plants[1].split(",") if plants else []
    return [], "", []


def follow(source: str, rig: str, given: Sequence[str], drive: str, plants: Sequence[str], law: str) -> str:
    """Follow remedies until a run could start, or until one has nothing to type; return the last error.

    Raise AssertionError if a remedy leads back to settings that were refused before.
    """
    state, seen = (tuple(given), drive, tuple(plants)), list[Any]()
    for _ in range(MAX_REMEDIES):
        assert state not in seen, f"{rig}, {law}: remedies lead in a circle: {[*seen, state]}"
        seen.append(state)
        sets, drive, plants = state
        try:
            scenario = load_scenario(source, rig=rig, overrides=sets)
            case = Case.of(scenario, controller=law, drive=DRIVES.checked(drive), plants=plants)
            case.prepare()
            for plant in plants:
                ALL_PLANTS.make(plant, scenario, DRIVES.checked(drive))
        except InputError as error:
            more, other_drive, other_plants = typed(error.remedy)
            if not (more or other_drive or other_plants):
                return str(error)
            keys = {text.partition("=")[0] for text in more}
            kept = [text for text in sets if text.partition("=")[0] not in keys]
            state = ((*kept, *more), other_drive or drive, tuple(other_plants) or plants)
        else:
            return ""
    raise AssertionError(f"{rig}, {law}: {MAX_REMEDIES} remedies are not enough: {seen}")


def odd_settings(rng: np.random.Generator) -> list[str]:
    """Return up to three random numbers of the rig, the effects or the control, over their whole ranges."""
    limits: dict[str, list[float]] = {"control.period": [1e-5, 0.1], "control.physics_step": [1e-6, 0.05]}
    limits |= {f"rig.{name}_time_constant": [1e-3, 0.5] for name in ("bridge", "trolley", "winch")}
    limits |= {f"rig.{name}_mass": [1e-3, 1e5] for name in ("bridge", "trolley", "winch", "load")}
    for effect, field in EffectNumbers.model_fields.items():
        model: Any = field.annotation
        for key, value in ends(model):
            limits.setdefault(f"effects.{effect}.{'.'.join(map(str, key))}", []).append(value)
    settings = [f"effects.{name}={{}}" for name in EffectNumbers.model_fields if rng.random() < 0.15]
    for key in rng.choice(sorted(limits), rng.integers(0, 4), replace=False):
        low, high = min(limits[key]), max(limits[key])
        value = float(np.exp(rng.uniform(np.log(max(low, 1e-6)), np.log(max(high, 1e-5)))))
        value = round(value, 9) if key.startswith("control") else value
        settings.append(f"{key}={int(value) if isinstance(limits[key][0], int) else value!r}")
    return settings


@pytest.mark.parametrize("seed", range(MANY))
def test_remedies_do_not_lead_in_a_circle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rig, drive = str(rng.choice(RigFile.names())), str(rng.choice([*DRIVES]))
    plants = [str(name) for name in rng.permutation(PLANTS)[: rng.integers(1, 3)]]
    law = str(rng.choice(["lqr", "pid", "lqr-integral", "flat-velocity", "pole-placement+hinf"]))
    low, high = RigFile.load(rig).workspace.T
    x, y, rope = (low + rng.uniform(0.3, 0.7, 3) * (high - low)).tolist()
    Path("still.toml").write_text(STILL)
    start = f"reference.start={[x, y, -rope]}"
    pushed = ["disturbances=[{joint='alpha', start=0.01, magnitude=0.1}]"] * int(rng.integers(0, 2))
    follow("still.toml", rig, [start, *pushed, *odd_settings(rng)], drive, plants, law)


@pytest.mark.parametrize("seed", range(4 * MANY))
def test_times_that_are_proposed_fit_to_the_nanosecond(seed: int) -> None:
    """Periods, steps and lags of any digits end in a run: each proposed time divides the others exactly."""
    rng = np.random.default_rng(seed)
    period = round(float(np.exp(rng.uniform(np.log(2e-4), np.log(0.02)))), 9)
    step = round(period * float(rng.uniform(0.1, 1.0)), 9)
    lag = float(np.exp(rng.uniform(np.log(1e-3), np.log(0.1))))
    settings = [f"control.period={period!r}", f"control.physics_step={step!r}", f"duration={1000 * step!r}"]
    settings += [f"rig.{name}_time_constant={lag!r}" for name in ("bridge", "trolley", "winch")]
    Path("still.toml").write_text(STILL)
    assert follow("still.toml", "lab-rig", settings, "velocity", ["analytic"], "lqr") == ""


def test_periods_of_an_experiment_may_be_the_bounds(refusal: Command) -> None:
    experiment = ["new", "experiment", "lab-rig", "--period"]
    found = re.search(r"periods from (\S+) to (\S+) s", refusal(*experiment, "500", "--in", "no"))
    assert found is not None
    assert main([*experiment, found[2], "--in", "longest"]) == 0
    refusal(*experiment, repr(1.1 * float(found[2])), "--in", "no")


@pytest.mark.parametrize("weight", [0.013, 0.1, 0.77])
def test_the_smallest_gamma_is_a_gamma(weight: float, refusal: Command) -> None:
    design = ["design", "lqr+hinf", "--set", f"design.hinf.control_weight={weight * 1e-3!r}", "--set"]
    found = re.search(r"gamma of at least (\S+),", refusal(*design, "design.hinf.gamma=1e-3"))
    assert found is not None
    assert main([*design, f"design.hinf.gamma={found[1]}"]) == 0


@pytest.mark.parametrize("value", [0.0276, 0.02749, 0.1204, 0.3])
def test_certified_delays_are_rounded_down(value: float) -> None:
    """The largest delay that is certified can be typed; rounded to the nearest it might be refused."""
    row = CertificateTables.limits([LargestValues(OperatingPoint(0.7), value, value, value, value)]).rows[0]
    for cell in row[1:]:
        assert 0.99 * value < float(cell.text) / 1e3 <= value * (1.0 + 1e-12)
