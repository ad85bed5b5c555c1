"""Every setting of a scenario changes a run or its plan, is refused, or is reported as having no effect.

The settings come from the models, so that new ones are tried too. `make test-more` tries each on a fixed
share of the plants, drives and controllers; RANGE_CASES=all tries all.
"""

import functools
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.controllers.registry import ALL_CONTROLLERS, WHERE, controller_names
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.metrics import Limits, LimitVerdict, run_metrics
from cranectl.planning import load_scenario
from cranectl.plants.entry import PlantEntry
from cranectl.plants.plant import DRIVES
from cranectl.plants.registry import PLANTS as PLANT_ENTRIES
from cranectl.scenario import Scenario
from cranectl.scenario.load import ScenarioFile
from cranectl.scenario.rig import ModelNames
from cranectl.simulate import simulate_run
from cranectl.simulate.idle_settings import RunKind
from cranectl.support.errors import InputError
from cranectl.support.trees import Tree
from tests.campaign.test_without_effect import other_value
from tests.campaign.test_without_effect import overrides_of as shown_by
from tests.conftest import PLANTS

find_idle_settings = RunKind.find_idle_settings
SCENARIO = "off-reference"
SHORT = [
    "duration=1",
    'reference.segments=[{kind="line",to=[0.72,0.52,-0.61],duration=0.5},'
    '{kind="line",to=[0.69,0.49,-0.57],duration=0.5}]',
    'disturbances=[{joint="alpha",start=0.1,end=0.3,magnitude=1.0},'
    '{joint="beta",start=0.2,end=0.5,magnitude=1.0},{force=[1.0,1.0,1.0],start=0.1,end=0.3}]',
    'obstacles=[{name="box",low=[1.0,0.8,-1.4],high=[1.2,1.0,-0.9]}]',
    "limits.rms_error_m=0.05",
    "rig.trolley_motor_mass=0.5",
]  # fmt: skip
CONTROLLERS = controller_names()
KINDS = [(plant, drive) for plant in PLANTS for drive in DRIVES]
ALL = os.environ.get("RANGE_CASES") == "all"
MAX_KINDS = 2  # combinations of plant and drive on which `make test-more` tries a setting
LABELS = {
    "name": "of the run, for people and files",
    "title": "for people",
    "obstacles.name": "for messages",
    "rig.look.frame": "drawn only; tests/log/test_scene.py has it",
    "log.every": "of the log; the test below has it",
    "controller.name": "the controllers here are named by the command",
    "rig.rated_load": "scales what is not given; tests/scenario/test_similarity.py has it",
    "reference.continuity": "what a reference is refused for; tests/reference/test_trajectory.py has it",
}
ELSEWHERE = {
    "limits": "a table of metrics by name, of which one is tried",
    "rig.axes": "the axes that a crane has; tests/plants/test_fewer_axes.py",
    "rig.rope": "the same",
    "control.physics_step": "absent by default; tests/plants/test_steps.py has it",
    **{
        f"rig.{name}": "of a model file; tests/plants/test_model_in_rig.py and test_own_model.py have them"
        for name in ("model", *(f"plant.names.{key}" for key in ModelNames.model_fields))
    },
}
# Overrides without which a setting has no effect.
CONDITIONS = {
    "workspace.on_exit": ["rig.bridge_range=[0.0,0.72]", "reference.segments=[]"],
    "rig.effects.rope.on_slack": ["disturbances=[{force=[0.0,0.0,12.0],start=0.1}]"],
    "effects.rope.on_slack": ["effects.rope={}", "disturbances=[{force=[0.0,0.0,12.0],start=0.1}]"],
    "metrics.settling_tolerance": [
        'reference.segments=[{kind="line",to=[0.72,0.52,-0.61],duration=0.5}]',
        "metrics.settling_tolerance=1.0",
    ],
    "obstacles.0.low.2": ['obstacles=[{name="box",low=[1.0,0.8,-0.4],high=[1.2,1.0,-0.2]}]'],
}  # fmt: skip
OTHER_VALUES: dict[str, Any] = {
    "workspace.on_exit": "stop",
    "effects.rope.on_slack": "recover",
    "rig.effects.rope.on_slack": "recover",
    "expected": "workspace-left",
    "metrics.settling_tolerance": 1e-3,
    "design.hinf.gamma": 1.0,
    "rig.look.load_radius": 0.2,
    "disturbances.0.joint": "beta",
    "disturbances.1.joint": "alpha",
    "limits.rms_error_m": 1e-6,
    "effects.rope.stiffness": 4e4,
    "obstacles.0.low.2": -0.5,
    "obstacles.0.high.2": -0.8,
}


def overrides_of(plant: str, drive: str) -> list[str]:
    own = ("duration", "reference.segments", "disturbances")
    return [*(line for line in shown_by(plant, drive) if not line.startswith(own)), *SHORT]


def outcome(overrides: list[str], plant: str, drive: str, controller: str) -> tuple[Scenario, Any]:
    """Return the scenario and the results of a run, without its settings and unused set-points."""
    scenario = load_scenario(SCENARIO, overrides=overrides)
    run = simulate_run(scenario, plant=plant, drive=drive, controller=controller)
    metrics = run_metrics(run)
    assert metrics is not None
    verdicts = LimitVerdict.judge(metrics, Limits.by_plant(scenario, [plant])[plant])
    moved = run.block("state").tobytes(), run.block("load").tobytes(), run.reference.tobytes()
    return scenario, (moved, metrics.to_json(), verdicts, run.status.label == scenario.expected)


@functools.cache
def usual_outcome(
    overrides: tuple[str, ...], plant: str, drive: str, controller: str
) -> tuple[Scenario, Any]:
    return outcome(list(overrides), plant, drive, controller)


def parameters() -> dict[str, Any]:
    """Return another value of each parameter of each controller that has its own table."""
    values: dict[str, Any] = {}
    for controller in WHERE:
        for parameter in ALL_CONTROLLERS[controller].parameters:
            others = [choice for choice in parameter.choices if choice != parameter.default]
            number = 1.1 * parameter.default if isinstance(parameter.default, float) else 0.0
            values[f"controller.{controller}.{parameter.name}"] = others[0] if others else number or 0.1
    return values


def other(name: str, value: Any) -> Any:
    if name in OTHER_VALUES:
        return OTHER_VALUES[name]
    if isinstance(value, bool):
        return not value
    return None if value is None or isinstance(value, str) else other_value(name, value)


def settings_of(plant: str, drive: str) -> dict[str, Any]:
    """Return another value of each setting that runs on the plant can have."""
    scenario = load_scenario(SCENARIO, overrides=overrides_of(plant, drive))
    assumed = scenario.model_dump(mode="json", exclude={"reference", "planning", "controller"})
    values = {name: other(name, value) for name, value in Tree(assumed).leaves()}
    return {name: value for name, value in {**values, **parameters()}.items() if value is not None}


def cases(plant: str, drive: str) -> Iterator[tuple[str, Any, str]]:
    """Yield settings with another value and a controller: all, or a share of them."""
    for index, (name, value) in enumerate(settings_of(plant, drive).items()):
        rng = np.random.default_rng(index)
        chosen = rng.permutation(len(KINDS))[:MAX_KINDS]
        own = name.split(".")[1] if name.startswith("controller.") else ""
        controllers = [str(rng.choice(CONTROLLERS)), *([own] if own else [])]
        if ALL or KINDS.index((plant, drive)) in chosen or name in CONDITIONS:
            for controller in ["lqr"] if name in CONDITIONS else CONTROLLERS if ALL else controllers:
                yield name, value, controller


@pytest.mark.slow
@pytest.mark.parametrize(("plant", "drive"), KINDS)
def test_a_setting_changes_a_run_or_is_refused_or_reported(plant: str, drive: str) -> None:
    wrong = []
    for name, value, controller in cases(plant, drive):
        if label(name) in LABELS:
            continue
        overrides = [*overrides_of(plant, drive), *CONDITIONS.get(name, ())]
        try:
            _, before = usual_outcome(tuple(overrides), plant, drive, controller)
            overrides.append(f"{name}={json.dumps(value)}")
            scenario, after = outcome(overrides, plant, drive, controller)
        except InputError as error:
            assert error.allowed or error.remedy  # noqa: PT017
            continue
        read = ScenarioFile.read(SCENARIO, overrides=overrides)
        assumed: Any = find_idle_settings(scenario, read, [name], [RunKind(plant, drive, controller)])  # type: ignore[arg-type]
        assumed = assumed or scenario.idle_effects([name])
        if bool(assumed) == (after != before):
            wrong.append(
                (name, controller, "changes nothing" if not assumed else f"changes, in spite of {assumed}")
            )
    assert not wrong, "\n".join(map(str, wrong))


def label(name: str) -> str:
    """Return a name without the indices of lists."""
    return ".".join(part for part in name.split(".") if not part.isdecimal())


def schema_names(node: dict[str, Any], definitions: dict[str, Any], name: str = "") -> Iterator[str]:
    """Yield the names of all settings in a schema, also inside of lists and unions."""
    while "$ref" in node:
        node = definitions[node["$ref"].rpartition("/")[2]]
    below = [*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("prefixItems", ())]
    if isinstance(node.get("items"), dict):
        below.append(node["items"])
    for part in below:
        yield from schema_names(part, definitions, name)
    for key, value in node.get("properties", {}).items():
        yield from schema_names(value, definitions, f"{name}.{key}" if name else key)
    if not below and not node.get("properties") and node.get("type") != "null":
        yield name


def test_every_setting_of_the_models_is_tried() -> None:
    """Segments and the settings of their planning have tests elsewhere."""
    schema = Scenario.model_json_schema()
    known = {label(name) for plant, drive in KINDS for name in settings_of(plant, drive)}
    missing = {
        name
        for name in schema_names(schema, schema["$defs"])
        if name not in known and name not in LABELS and name.split(".")[0] not in ("reference", "planning")
    }
    assert missing == set(ELSEWHERE)
    assert known.isdisjoint(
        set(LABELS) - {"rig.look.frame", "rig.rated_load", "log.every"} - {"name", "title", "obstacles.name"}
    )


def test_names_of_a_model_file_change_nothing_on_a_shipped_plant() -> None:
    name = "rig.plant.names.load"
    read = ScenarioFile.read(SCENARIO, overrides=[*SHORT, f"{name}=hook"])
    uses = [RunKind("mujoco", "ideal", "lqr")]
    assert find_idle_settings(read, read, [name], uses) == {
        "the MuJoCo plant is not from a model file": [name]
    }


def test_how_often_a_log_is_written_to_is_a_setting(tmp_path: Path) -> None:
    sizes = []
    for every in (1, 10):
        scenario = load_scenario(SCENARIO, overrides=[*SHORT, f"log.every={every}"])
        write_log(tmp_path / "a.mcap", [simulate_run(scenario, plant="analytic")])
        sizes.append(len(read_log(tmp_path / "a.mcap")["analytic"].time_ns))
    assert sizes == [1001, 101]


@pytest.mark.parametrize(
    ("name", "value", "zeros"),
    [
        ("effects.wind.gust_time", 1.0, ["effects.wind.gust=0.0"]),
        ("effects.wind.seed", 3, ["effects.wind.density=0.0"]),
        ("effects.sensing.seed", 3, ["effects.sensing.angle_noise=0.0"]),
        ("disturbances.2.start", 0.2, ["disturbances.2.force=[0.0,0.0,0.0]"]),
        ("disturbances.1.end", 0.4, ["disturbances.1.magnitude=0.0"]),
        ("design.hinf.back_off", 1.2, ["design.hinf.gamma=2.0"]),
        ("controller.pid.rope_length", 0.5, ["controller.pid.shaper=none"]),
        ("limits.mujoco.max_error_m", 1e-6, []),
    ],
)
def test_a_setting_that_needs_another_number_is_reported(name: str, value: float, zeros: list[str]) -> None:
    controller = "pid" if "pid" in name else "lqr+hinf"
    overrides = ["effects.wind={}", "effects.sensing={}", *SHORT, *zeros]
    _, before = outcome(overrides, "analytic", "ideal", controller)
    scenario, after = outcome([*overrides, f"{name}={value}"], "analytic", "ideal", controller)
    assert after == before
    assert find_idle_settings(scenario, scenario, [name], [RunKind("analytic", "ideal", controller)])


@pytest.mark.parametrize(("drive", "reads"), [("ideal", True), ("velocity", False), ("force", True)])
def test_the_observer_is_idle_where_nobody_reads_its_estimates(drive: Any, reads: bool) -> None:
    """PID commands speeds to velocity drives, and their record has the acceleration of the drive itself."""
    sensing = ["effects.sensing={}", *SHORT]
    name = "effects.sensing.observer_bandwidth"
    _, before = outcome(sensing, "analytic", drive, "pid")
    scenario, after = outcome([*sensing, f"{name}=80.0"], "analytic", drive, "pid")
    assert (after != before) is reads
    assert (
        bool(find_idle_settings(scenario, scenario, [name], [RunKind("analytic", drive, "pid")])) is not reads
    )


def test_what_a_plant_of_another_package_excludes_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = PlantEntry(
        name="own", label="own", colour="series-4", where="own:Own", batch=2, by_default=False,
        lacks={"wind": "which has no air"}, fixed={"bridge_mass": 6.0},
    )  # fmt: skip
    monkeypatch.setitem(PLANT_ENTRIES, "own", entry)
    scenario = load_scenario(SCENARIO, overrides=["effects.wind={}"])
    for name in ("effects.wind.gust", "rig.bridge_mass"):
        assert find_idle_settings(scenario, scenario, [name], [RunKind("own", "velocity", "lqr")])
    assert not find_idle_settings(
        scenario, scenario, ["rig.trolley_mass"], [RunKind("own", "velocity", "lqr")]
    )
