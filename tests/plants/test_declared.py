"""What a plant of another package honours: declared, tried at first use, and refused by name otherwise."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import cranectl
from cranectl.campaign.load import load_campaign
from cranectl.planning import load_scenario
from cranectl.plants.analytic import AnalyticPlant
from cranectl.plants.capabilities import check_scenario
from cranectl.plants.elastic.plant import ElasticPlant
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.registry import PLANTS, PlantEntry
from cranectl.plants.trials import check_honest
from cranectl.scenario import Scenario
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import make_plant, simulate_run
from cranectl.support.errors import InputError

RIGID = PLANTS["analytic"].lacks


class Calm(AnalyticPlant):
    """Knows no disturbances."""

    def advance(self, command: Any, disturbance: Any, wind: Any, load: Any) -> None:
        still = np.concatenate([wind[:3], np.zeros(3)])
        super().advance(command, np.zeros_like(disturbance), still, load)


class Becalmed(AnalyticPlant):
    """Knows no air."""

    def advance(self, command: Any, disturbance: Any, wind: Any, load: Any) -> None:
        super().advance(command, disturbance, np.concatenate([np.zeros(3), wind[3:]]), load)


class Built(AnalyticPlant):
    """Has a load of its own."""

    def __init__(self, rig: RigParameters, **options: Any) -> None:
        super().__init__(rig.model_copy(update={"load_mass": 2.5}), **options)


class Upside(AnalyticPlant):
    """Is accelerated the wrong way."""

    def advance(self, command: Any, disturbance: Any, wind: Any, load: Any) -> None:
        super().advance(command, -disturbance, wind, load)


class Frictionless(ElasticPlant):
    """Claims what the elastic plant shows, without friction, frame and lag."""

    def __init__(self, rig: RigParameters, *, effects: Any, **options: Any) -> None:
        shown = effects.model_copy(update={"friction": None, "frame": None})
        super().__init__(rig.model_copy(update={"bridge_time_constant": 0.02}), effects=shown, **options)


class Hookless(ElasticPlant):
    """Knows a body, and nothing of its hook."""

    def __init__(self, rig: RigParameters, *, effects: Any, **options: Any) -> None:
        body = effects.body and effects.body.model_copy(update={"hook_mass": 0.0})
        super().__init__(rig, effects=effects.model_copy(update={"body": body}), **options)


for plant_class in (Calm, Becalmed, Built, Upside, Frictionless, Hookless):
    plant_class.kernels = None  # stepped from Python, as plants of other packages may be


@pytest.fixture
def registered() -> Iterator[Any]:
    names = []

    def register(kind: type, **declared: Any) -> PlantEntry:
        name = kind.__name__.lower()
        entry = PlantEntry(
            name=name, label=name, colour="series-4", where=f"{__name__}:{kind.__name__}", batch=2,
            **{"lacks": RIGID, "by_default": False, **declared},
        )  # fmt: skip
        cranectl.register_plant(entry)
        names.append(name)
        return entry

    yield register
    for name in names:
        del PLANTS[name]


IGNORED = {
    Calm: ("disturbances, disturbances.force", "velocity"),
    Becalmed: ("wind", "ideal"),
    Built: ("rig.load_mass", "velocity"),
    Upside: ("disturbances", "ideal"),
}


@pytest.mark.parametrize("kind", IGNORED)
def test_a_plant_that_ignores_a_setting_is_refused_at_its_first_run(registered: Any, kind: type) -> None:
    named, drive = IGNORED[kind]
    name = registered(kind).name
    with pytest.raises(InputError) as error:
        make_plant(name, load_scenario("fixed-position"), drive)
    assert error.value.found == f"the {name} plant accepts {named} with {drive} drives and does not react"
    assert "PlantEntry: " in error.value.remedy


def test_the_remedy_is_a_declaration_that_works(registered: Any) -> None:
    entry = registered(Frictionless, lacks={}, servos=True, drives=("velocity",))
    with pytest.raises(InputError) as error:
        check_honest(entry.name, "velocity")
    for name in ("friction.coulomb", "friction.pivot_viscous", "frame", "rig.bridge_time_constant"):
        assert name in error.value.found
    declared = eval(f"dict({error.value.remedy.partition('PlantEntry: ')[2]})")
    del PLANTS[entry.name]
    PLANTS[entry.name] = PlantEntry(**{**vars(entry), **declared})
    check_honest(entry.name, "velocity")
    with pytest.raises(
        InputError, match=r"effects\.friction\.coulomb on the frictionless plant, which has none"
    ):
        check_scenario(crane("effects.friction={}"), plant=entry.name, drive="velocity")


def test_a_hook_without_mass_is_declared_by_itself(registered: Any) -> None:
    entry = registered(Hookless, lacks={})
    with pytest.raises(InputError, match=r"accepts body\.hook_mass with ideal drives"):
        check_honest(entry.name, "ideal")
    del PLANTS[entry.name]
    PLANTS[entry.name] = PlantEntry(**{**vars(entry), "lacks": {"body.hook_mass": "whose hook is a knot"}})
    check_honest(entry.name, "ideal")
    check_scenario(crane("effects.body={}"), plant=entry.name, drive="ideal")
    with pytest.raises(InputError, match=r"effects\.body\.hook_mass on the hookless plant, whose") as error:
        check_scenario(crane("effects.body={hook_mass=0.1}"), plant=entry.name, drive="ideal")
    assert error.value.remedy.endswith("or set effects.body.hook_mass = 0.0")


LACKS = {
    "disturbances": (
        {"disturbances": "which knows none"},
        "disturbances on the calm plant, which knows none",
    ),
    "force": (
        {"disturbances.force": "which knows angles"},
        "forces among the disturbances on the calm plant, which knows angles",
    ),
    "wind": (
        {"wind": "which stands in a hall"},
        r"\[effects\.wind\] on the calm plant, which stands in a hall",
    ),
}
ACTING = {
    "disturbances": "disturbances=[{joint='alpha', start=1.0, magnitude=0.1}]",
    "force": "disturbances=[{start=1.0, force=[1.0, 0.0, 0.0]}]",
    "wind": "effects.wind={}",
}


def crane(text: str) -> Scenario:
    return load_scenario("settled-trajectory", overrides=["disturbances=[]", text])


@pytest.mark.parametrize("case", LACKS)
def test_what_a_plant_lacks_is_refused_by_name_and_the_rest_runs(registered: Any, case: str) -> None:
    lacks, found = LACKS[case]
    registered(Calm, lacks={**RIGID, **lacks})
    with pytest.raises(InputError, match=found) as error:
        check_scenario(
            load_scenario("settled-trajectory", overrides=[ACTING[case]]), plant="calm", drive="ideal"
        )
    assert error.value.allowed
    assert "--plants analytic" in error.value.remedy
    others = [
        text for name, text in ACTING.items() if name != case and (case, name) != ("disturbances", "force")
    ]
    for text in others:
        check_scenario(crane(text), plant="calm", drive="ideal")


def test_a_number_that_is_built_in_is_refused_otherwise(registered: Any) -> None:
    registered(Built, fixed={"load_mass": 2.5})
    short = ["duration=3", "disturbances=[]"]
    with pytest.raises(InputError, match=r"load_mass = 1 on the built plant, which has 2\.5 built in"):
        simulate_run(load_scenario("fixed-position", overrides=short), plant="built")
    same = load_scenario("fixed-position", overrides=[*short, "rig.load_mass=2.5"])
    tension = simulate_run(same, plant="built").tension[0]
    assert tension == pytest.approx(2.5 * 9.81, rel=1e-3)


def test_a_campaign_does_not_vary_what_changes_nothing(registered: Any, tmp_path: Any) -> None:
    registered(Built, fixed={"load_mass": 2.5})
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\nscenario = "fixed-position"\ncontrollers = ["lqr"]\nplants = ["built"]\n'
        'drive = "ideal"\nruns = 4\nset = ["rig.load_mass=2.5"]\n'
        '[uncertain.rig.load_mass]\ndistribution = "uniform"\nlow = 2.0\nhigh = 3.0\n'
    )
    with pytest.raises(InputError, match="it is built into the built plant"):
        load_campaign(tmp_path / "mine.toml")


@pytest.mark.parametrize("declared", [{"lacks": {"wnid": "no"}}, {"fixed": {"mass": 1.0}}])
def test_a_declaration_of_what_there_is_not_is_refused(declared: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="of the plant mine"):
        PlantEntry(name="mine", label="mine", colour="series-4", where="a:B", batch=0, **declared)


@pytest.mark.parametrize("name", ["analytic", "elastic", "mujoco"])
@pytest.mark.parametrize("drive", ["ideal", "velocity", "force"])
def test_the_plants_of_the_package_keep_what_they_declare(registered: Any, name: str, drive: Any) -> None:
    """They are not tried in a run: the tests of their physics hold them to more."""
    entry = PLANTS[name]
    kind = {"analytic": AnalyticPlant, "elastic": ElasticPlant, "mujoco": MujocoPlant}[name]
    check_honest(registered(kind, lacks=entry.lacks, drives=entry.drives, servos=entry.servos).name, drive)
