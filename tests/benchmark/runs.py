"""Simulate the benchmark's controllers, which are files."""

from collections.abc import Sequence

from cranectl import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from tests.conftest import ROOT

FOLDER = ROOT / "validation" / "benchmark"
SHORT_STEPS = ("control.period=0.00025", "control.physics_step=0.00025")


def simulate(
    controller: str,
    *overrides: str,
    scenario: str = "fixed-position",
    plant: str = "analytic",
    drive: str = "ideal",
    assumed: Sequence[str] = (),
) -> Run:
    """Simulate `controller`, FILE:NAME in the benchmark's folder, which assumes a rig with other settings."""
    return simulate_run(
        load_scenario(scenario, overrides=overrides),
        nominal=load_scenario(scenario, overrides=[*overrides, *assumed]),
        plant=plant,
        drive=drive,
        controller=open_controller(str(FOLDER / controller)),
    )


def at_rest(length: float, offset: float, duration: float) -> list[str]:
    """Return settings of a crane with a rope of `length` [m] at rest, `offset` [m] from its target in x."""
    reference = [f"reference.start=[1.0, 0.77, {-length}]", "reference.segments=[]"]
    offsets = f"initial.load_offset=[{offset}, 0.0, 0.0]"
    return [f"duration={duration}", "disturbances=[]", *reference, offsets]
