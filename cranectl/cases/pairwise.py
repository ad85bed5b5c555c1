"""Compare every plant with every other over all cases, and each with itself at finer steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log2, nan

import numpy as np

from cranectl.cases.case import Case, PairDifference
from cranectl.cases.validation import Validation
from cranectl.compare import Agreement, compare_runs
from cranectl.plants import PLANTS, PhysicsStep
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, VELOCITY, Z
from cranectl.simulate import simulate_run
from cranectl.support import Array, InconsistentError, JSONRecord

SWING_DURATION = 20.0  # [s] of the free swing that shows the energy drift
SWING_ANGLES = (0.3, -0.2)  # at its start [rad]
ORDER_ROUNDING = 1e-14  # of the rope's length; smaller differences are rounding, which has no order


@dataclass(frozen=True)
class WorstPair:
    """Largest differences of two plants with the same drives over all cases."""

    drive: str  # kind of drive of both
    plant: str  # the plant that is compared
    reference: str  # the plant with which it is compared
    cases: int  # number of cases with both plants
    failed: int  # cases in which the plants disagree
    not_judged: int  # cases without a verdict on the plants
    load_m: float  # largest distance of the loads [m]
    angle_rad: float  # largest difference of a cardan angle [rad]
    tension_n: float  # largest difference of the tensions of the rope [N]
    scenario: str  # in which the loads are farthest apart
    controller: str  # of the same case

    def __post_init__(self) -> None:
        """Raise InconsistentError for more verdicts than cases."""
        InconsistentError.check_ascending(
            ("cases that failed or were not judged", self.failed + self.not_judged), ("cases", self.cases)
        )


@dataclass(frozen=True)
class PlantAlone:
    """Convergence of one plant in the case in which it is farthest from another with the same drives."""

    plant: str
    drive: str
    scenario: str
    controller: str
    step_error_m: float  # largest change of the load's position with steps a quarter as long
    order: float  # of convergence; NaN where differences are rounding
    energy_drift: float  # of a free swing of 20 s, as a share of m g l; NaN where drives cannot be locked


@dataclass(frozen=True)
class Pairwise(JSONRecord):
    """Result of `validate --pairwise`."""

    pairs: tuple[WorstPair, ...]  # one for each drive and pair of plants
    plants: tuple[PlantAlone, ...]  # one for each plant and drive in these pairs

    @classmethod
    def of(cls, validation: Validation) -> "Pairwise":
        """Summarise all pairs of plants in `validation`, and run the worst cases again with finer steps."""
        by_pair: dict[tuple[str, str, str], list[tuple[PairDifference, Case]]] = {}
        for case, result in validation.results:
            for pair in result.pairs:
                agreement = pair.agreement
                key = (agreement.drive, agreement.plant, agreement.reference)
                by_pair.setdefault(key, []).append((pair, case))
        worst = {key: max(pairs, key=lambda entry: _distance_of(entry[0])) for key, pairs in by_pair.items()}
        rows = tuple(
            _summarise_pair(key, [pair for pair, _ in pairs], worst[key][0].agreement)
            for key, pairs in by_pair.items()
        )
        cases: dict[tuple[str, str], tuple[float, Case]] = {}
        for (drive, *plants), (pair, case) in worst.items():
            for plant in plants:
                size = _distance_of(pair)
                if size > cases.get((plant, drive), (-1.0, case))[0]:
                    cases[plant, drive] = (size, case)
        drift: dict[str, float] = {}
        alone = []
        for plant in PLANTS.in_order(plant for plant, _ in cases):
            for drive in dict.fromkeys(drive for other, drive in cases if other == plant):
                case = cases[plant, drive][1]
                if plant not in drift:
                    can_lock = "ideal" in PLANTS.entry(plant).drives
                    drift[plant] = energy_drift(plant, case.scenario) if can_lock else nan
                steps = convergence(plant, case)
                alone.append(
                    PlantAlone(plant, drive, case.scenario.name, case.controller, *steps, drift[plant])
                )
        return cls(rows, tuple(alone))


def _distance_of(pair: PairDifference) -> float:
    return float(np.nan_to_num(pair.agreement.max_load_error_m, nan=np.inf))


def _summarise_pair(
    key: tuple[str, str, str], pairs: Sequence[PairDifference], farthest: Agreement
) -> WorstPair:
    return WorstPair(
        *key,
        cases=len(pairs),
        failed=sum(pair.agreement.passed is False for pair in pairs),
        not_judged=sum(pair.agreement.passed is None for pair in pairs),
        load_m=farthest.max_load_error_m,
        angle_rad=max(pair.agreement.max_angle_error_rad for pair in pairs),
        tension_n=max(pair.max_tension_error_n for pair in pairs),
        scenario=farthest.scenario,
        controller=farthest.controller,
    )


def convergence(plant: str, case: Case) -> tuple[float, float]:
    """Return the change of the load with steps a quarter as long [m], and the order of convergence."""
    runs = []
    for factor in (1, 2, 4):
        scenario = PhysicsStep(case.scenario, case.drive).refined(factor)
        if scenario is None:
            return nan, nan
        runs.append(simulate_run(scenario, plant=plant, drive=case.drive, controller=case.controller))
    coarse, fine, total = (
        compare_runs(runs[a], runs[b], signals=()).max_load_error_m for a, b in ((0, 1), (1, 2), (0, 2))
    )
    rounding = ORDER_ROUNDING * case.scenario.rig.rope_range[1]
    return total, log2(coarse / fine) if fine > rounding else nan


def energy_drift(plant: str, scenario: Scenario) -> float:
    """Return the largest change of energy in a free swing of 20 s with locked drives, as a share of m g l."""
    rigid = scenario.model_copy(update={"effects": type(scenario.effects)(), "disturbances": ()})
    crane = PLANTS.make(plant, rigid, "ideal")
    (x, y), lengths = np.mean(rigid.rig.workspace[:2], axis=1), rigid.rig.rope_range
    state, load = np.zeros(10), np.zeros(7)
    state[[BRIDGE, TROLLEY, ROPE, ALPHA, BETA]] = x, y, 0.5 * sum(lengths), *SWING_ANGLES
    crane.reset(state)
    no_input: tuple[Array, Array, Array] = (np.zeros(3), np.zeros(2), np.zeros(6))
    energies = []
    for _ in range(round(SWING_DURATION * NANOSECONDS / rigid.period_ns)):
        crane.advance(*no_input, load)
        speed = load[VELOCITY : VELOCITY + 3]
        energies.append(0.5 * float(speed @ speed) + rigid.rig.gravity * float(load[Z]))
    return float(np.ptp(energies) / (rigid.rig.gravity * state[ROPE]))
