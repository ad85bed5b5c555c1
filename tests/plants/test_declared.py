"""What a plant of another package honours: declared, tried at first use, and refused by name otherwise."""

from typing import Any

import numpy as np
import pytest

from cranectl.campaign.load import load_campaign
from cranectl.planning import load_scenario
from cranectl.plants.analytic import AnalyticPlant
from cranectl.plants.elastic.plant import ElasticPlant
from cranectl.plants.entry import PlantEntry
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.plant import DRIVES
from cranectl.plants.registry import PLANTS
from cranectl.plants.trials import check_honest
from cranectl.scenario import Scenario
from cranectl.scenario.rig import RigParameters
from cranectl.support.errors import InputError

RIGID = PLANTS["analytic"].lacks


class Odd(AnalyticPlant):
    """Feels disturbances, air and forces times a factor, and may have a load of its own."""

    def __init__(
        self, rig: RigParameters, *, feels: tuple[float, ...], load: float | None = None, **options: Any
    ) -> None:
        super().__init__(rig.model_copy(update={"load_mass": load} if load else {}), **options)
        self.feels = feels

    def advance(self, command: Any, disturbance: Any, wind: Any, load: Any) -> None:
        turn, air, force = self.feels
        wind = np.concatenate([air * wind[:3], force * wind[3:]])
        super().advance(command, turn * disturbance, wind, load)


class Frictionless(ElasticPlant):
    """Claims what the elastic plant shows, without friction, frame and lag."""

    def __init__(self, rig: RigParameters, *, effects: Any, **options: Any) -> None:
        shown = effects.model_copy(update={"friction": None, "frame": None})
        super().__init__(rig.model_copy(update={"bridge_time_constant": 0.02}), effects=shown, **options)


Odd.kernels = Frictionless.kernels = None  # stepped from Python, as plants of other packages may be
ALL_FELT, BUILT = (1.0, 1.0, 1.0), 2.5
ODD = {"feels": ALL_FELT, "load": BUILT}


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> Any:
    def register(kind: type, **declared: Any) -> PlantEntry:
        name = kind.__name__.lower()
        entry = PlantEntry(
            name=name, label=name, colour="series-4", where=f"{__name__}:{kind.__name__}", batch=2,
            **{"lacks": RIGID, "by_default": False, **declared},
        )  # fmt: skip
        monkeypatch.setitem(PLANTS, name, entry)
        return entry

    return register


@pytest.mark.parametrize(
    ("arguments", "named", "drive"),
    [
        ({"feels": (0.0, 1.0, 0.0)}, "disturbances, disturbances.force", "velocity"),
        ({"feels": (1.0, 0.0, 1.0)}, "wind", "ideal"),
        (ODD, "rig.load_mass", "velocity"),
        ({"feels": (-1.0, 1.0, 1.0)}, "disturbances", "ideal"),
    ],
)
def test_a_plant_that_ignores_a_setting_is_refused_at_its_first_run(
    registered: Any, arguments: dict[str, Any], named: str, drive: Any
) -> None:
    registered(Odd, arguments=arguments)
    with pytest.raises(InputError) as error:
        PLANTS.make("odd", load_scenario("fixed-position"), drive)
    assert error.value.found == f"the odd plant accepts {named} with {drive} drives and does not react"
    assert "PlantEntry: " in error.value.remedy


def test_the_remedy_is_a_declaration_that_works(registered: Any) -> None:
    entry = registered(Frictionless, lacks={}, servos=True, drives=("velocity",))
    with pytest.raises(InputError) as error:
        check_honest(entry.name, "velocity")
    for name in ("friction.coulomb", "friction.pivot_viscous", "frame", "rig.bridge_time_constant"):
        assert name in error.value.found
    declared = eval(f"dict({error.value.remedy.partition('PlantEntry: ')[2]})")
    registered(Frictionless, **{"lacks": {}, "servos": True, "drives": ("velocity",), **declared})
    check_honest(entry.name, "velocity")
    with pytest.raises(
        InputError, match=r"effects\.friction\.coulomb on the frictionless plant, which has none"
    ):
        PLANTS.entry(entry.name).check_scenario(crane("effects.friction={}"), "velocity")


def crane(text: str) -> Scenario:
    return load_scenario("settled-trajectory", overrides=["disturbances=[]", text])


def test_a_plant_may_lack_forces_among_the_disturbances_only(registered: Any) -> None:
    registered(Odd, lacks={**RIGID, "disturbances.force": "which knows angles"})
    for text in ("disturbances=[{joint='alpha', start=1.0, magnitude=0.1}]", "effects.wind={}"):
        PLANTS.entry("odd").check_scenario(crane(text), "ideal")
    force = crane("disturbances=[{start=1.0, force=[1.0, 0.0, 0.0]}]")
    found = "forces among the disturbances on the odd plant, which knows angles"
    with pytest.raises(InputError, match=found) as error:
        PLANTS.entry("odd").check_scenario(force, "ideal")
    assert "--plants analytic" in error.value.remedy


def test_a_campaign_does_not_vary_what_changes_nothing(registered: Any, tmp_path: Any) -> None:
    registered(Odd, arguments=ODD, fixed={"load_mass": BUILT})
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\nscenario = "fixed-position"\ncontrollers = ["lqr"]\nplants = ["odd"]\n'
        'drive = "ideal"\nruns = 4\nset = ["rig.load_mass=2.5"]\n'
        '[uncertain.rig.load_mass]\ndistribution = "uniform"\nlow = 2.0\nhigh = 3.0\n'
    )
    with pytest.raises(InputError, match="it is built into the odd plant"):
        load_campaign(tmp_path / "mine.toml")


@pytest.mark.parametrize("name", ["analytic", "elastic", "mujoco"])
@pytest.mark.parametrize("drive", DRIVES)
def test_the_plants_of_the_package_keep_what_they_declare(registered: Any, name: str, drive: Any) -> None:
    """They are not tried in a run: the tests of their physics hold them to more."""
    entry = PLANTS[name]
    kind = {"analytic": AnalyticPlant, "elastic": ElasticPlant, "mujoco": MujocoPlant}[name]
    check_honest(registered(kind, lacks=entry.lacks, drives=entry.drives, servos=entry.servos).name, drive)
