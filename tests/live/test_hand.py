"""Sessions that are driven by hand: from when on, until when, and that runs repeat them to the bit."""

import numpy as np

from cranectl.controllers.registry import controller_design
from cranectl.live.session import Session
from cranectl.reference import load_scenario
from cranectl.simulate import simulate_run

STILL = ("reference.segments=[]", "disturbances=[]", "duration=1.0")


def session(*overrides: str, name: str = "fixed-position", drive: str = "ideal") -> Session:
    scenario = load_scenario(name, overrides=[*STILL, *overrides])
    return Session(scenario, controller_design("lqr", scenario), drive=drive, plants=("analytic", "mujoco"))


def test_what_was_driven_is_repeated_to_the_bit() -> None:
    running = session()
    runs = [running.advance(370)]
    for samples, ask in (
        (400, (0.3, -0.2, 0.1)),
        (1234, (-0.45, 0.2, 0.0)),
        (20, None),
        (777, (0.1, 0.0, -0.2)),
    ):
        if ask:
            running.wish(ask)
        else:
            running.go((0.5, 0.5, -1.0))
        runs += [running.advance(7) for _ in range(samples // 7)]
    scenario = running.driven()
    for k, plant in enumerate(("analytic", "mujoco")):
        run = simulate_run(scenario, plant=plant)
        reference = np.vstack([each[k].reference for each in runs])
        assert np.array_equal(run.reference[: len(reference)], reference)
        table = np.vstack([each[k].table for each in runs])
        assert np.array_equal(run.table[: len(table)], table)
        print(run.status, len(table), len(run.table), np.ptp(table, axis=0)[:5])
