"""What a validation judged: its cranes and motions in words, a digest of its input, and the version."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cranectl.cases import Validation
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.reference import Trajectory
from cranectl.report.page import Fact
from cranectl.report.table import Cell, Table
from cranectl.scenario import Scenario
from cranectl.support import Provenance

PATH_SAMPLES = 2001  # of a reference whose length is shown
TONNE = 1000.0  # [kg] from which on a mass is shown in tonnes


def facts_of_masses(scenarios: Sequence[Scenario]) -> Iterator[Fact]:
    """Yield the masses, if all cranes have the same."""
    masses = {masses_of(scenario) for scenario in scenarios}
    if len(masses) == 1:
        load, others = masses.pop()
        yield Fact("Load", load, others)
    elif masses:
        yield Fact("Loads", f"{len(masses)} cranes", "each scenario below states its masses")


def made_with(validation: Validation) -> Table:
    """Return by what the page can be made again: digests of all that was judged, and the version."""
    controllers = ALL_CONTROLLERS.digests(dict.fromkeys(case.controller for case in validation.cases))
    versions = Provenance.now()
    facts = {
        "digest of all that was judged": input_digest(validation, controllers),
        **controllers,
        "cranectl": f"{versions['cranectl']}, sources {versions['sources']}",
    }
    return Table("", ("", ""), tuple(Cell.row(*fact) for fact in facts.items()), labels=2)


def masses_of(scenario: Scenario) -> tuple[str, str]:
    """Return the mass of the load, and in words those of trolley and bridge."""
    rig = scenario.rig
    motor = f" with a motor of {mass_text(rig.trolley_motor_mass)}" if rig.trolley_motor_mass else ""
    others = f"trolley {mass_text(rig.trolley_mass)}{motor}, bridge {mass_text(rig.bridge_mass)}"
    return mass_text(rig.load_mass), others


def input_digest(validation: Validation, controllers: Mapping[str, str]) -> str:
    """Return a digest of all that was judged: scenarios, controllers, drives, plants and this program."""
    digest = hashlib.sha256(json.dumps(Provenance.fingerprints(), sort_keys=True).encode())
    texts = {id(case.scenario): case.scenario.model_dump_json() for case in validation.cases}
    for case in validation.cases:
        own = controllers.get(f"law {case.controller}", "")
        judged = texts[id(case.scenario)], case.controller, own, case.drive, *case.plants
        digest.update(json.dumps(judged).encode())
    return digest.hexdigest()[: Provenance.DIGITS]


def mass_text(mass: float) -> str:
    """Return a mass [kg] in kg or t, with three digits."""
    return f"{mass / TONNE:.3g} t" if mass >= TONNE else f"{mass:.3g} kg"


def motion_text(scenario: Scenario) -> str:
    """Return load and motion in short: "32 t, 20 m in 35 s"."""
    trajectory, load = Trajectory.of(scenario.reference), mass_text(scenario.rig.load_mass)
    if not trajectory.motions:
        return f"{load}, held in place for {scenario.duration:g} s"
    course = trajectory.sample(np.linspace(0.0, trajectory.joints[-1], PATH_SAMPLES))[:, :3]
    length = np.linalg.norm(np.diff(course, axis=0), axis=1).sum()
    return f"{load}, {length:.3g} m in {sum(path.duration for path in trajectory.motions.values()):.3g} s"
