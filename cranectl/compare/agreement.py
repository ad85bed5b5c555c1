"""Judge whether plants agree: limits of their differences, and a verdict.

With each kind of drive, all plants solve the same equations. So the limits of `validation/tolerances.toml`
bound numerical errors only, and hold for every scenario, controller and rig with a stable loop. An unstable
loop amplifies these errors, and only shorter steps help. There is no verdict on a plant whose velocity drives
do not feel the load.
"""

import functools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from cranectl.compare.runs import Comparison, compare_runs
from cranectl.plants import DRIVES, PLANTS, Drive, PhysicsStep
from cranectl.scenario import NANOSECONDS, RigParameters, Scenario
from cranectl.simulate import Run, RunMemory, simulate_run
from cranectl.status import RunStatus
from cranectl.support import TOML, Arguments, InconsistentError, JSONRecord, Shipped

TOLERANCES = "validation/tolerances.toml"  # source of all limits
ORDER = 4  # of the MuJoCo plant's integration, the lowest of all plants without friction
MAX_HALVINGS = 4  # of the physics step

Progress = Callable[[float], None]  # called with the simulated seconds since the last call


@dataclass(frozen=True)
class AgreementLimits:
    """Largest allowed differences of two plants, with the reason for them."""

    load_m: float  # of the load [m]
    angle_rad: float  # of a cardan angle [rad]
    end_s: float  # between the ends of runs that stop early
    reason: str  # why they are as large as they are
    order: int = ORDER  # of the difference in control.physics_step

    @staticmethod
    def between(scenario: Scenario, drive: Drive, plants: Iterable[str]) -> "PairLimits":
        """Return the limits of each plant's difference from the reference plant among `plants`."""
        plants = list(plants)
        reference = PLANTS.reference(plants)
        return {
            (plant, reference): pair_limits(scenario, drive, (plant, reference))
            for plant in plants
            if plant != reference
        }


@dataclass(frozen=True)
class NoLimits:
    """The allowed difference is not known, so it is reported and not judged."""

    reason: str  # why nothing is judged


# By a plant and the one it is compared with.
PairLimits = Mapping[tuple[str, str], AgreementLimits | NoLimits]

ENCODER_STEPS = NoLimits(
    "the plants integrate one of the effects differently, so an encoder may read one step more on one plant, "
    "and a loop near instability amplifies this difference"
)
SMOOTHED_FRICTION = NoLimits("the analytic plant smooths Coulomb's friction of the joint, so it never sticks")


def pair_limits(scenario: Scenario, drive: Drive, pair: tuple[str, str]) -> AgreementLimits | NoLimits:
    """Return the limits of two plants in closed loop, or the reason why there are none."""
    without_servos = [plant for plant in pair if DRIVES[drive].is_servo and not PLANTS.entry(plant).servos]
    if without_servos:
        label = PLANTS.entry(without_servos[0]).label
        return NoLimits(f"velocity drives of the {label} plant do not feel the load, unlike those of others")
    for entry in map(PLANTS.entry, pair):
        if entry.differs:
            sizes = "cranectl info of its model tells the millimetres of each cause"
            return NoLimits(f"the {entry.label} plant is another crane: {entry.differs}; {sizes}")
    by_effect, limits = _closed_loop()["effects"], agreement_limits(drive)
    if scenario.effects.sensing and len(by_effect.keys() & set(scenario.effects.names)) > 1:
        return ENCODER_STEPS
    friction = scenario.effects.friction
    if friction and friction.pivot_coulomb and "analytic" in pair:
        return SMOOTHED_FRICTION
    # Effects add numerical errors; the limits of lengths are those of the laboratory rig.
    size = scenario.rig.rope_range[1] / RigParameters().rope_range[1]
    for name in scenario.effects.names:
        stated = by_effect.get(name, {})
        stated = {**stated, **stated.get(drive, {})}
        if stated:
            limits = replace(
                limits,
                load_m=max(limits.load_m, max(size, 1.0) * stated["load_m"]),
                angle_rad=max(limits.angle_rad, stated["angle_rad"]),
                reason=stated["reason"],
                order=min(limits.order, stated.get("order", ORDER)),
            )
    return limits


def agreement_limits(drive: str) -> AgreementLimits:
    """Return the limits of two plants with this kind of drives in closed loop, without effects."""
    by_drive = _closed_loop()
    strictest = by_drive["velocity"]  # for a kind of drives without own limits
    return AgreementLimits(**by_drive.get(drive, strictest))


@functools.cache
def _closed_loop() -> dict[str, Any]:
    """Read the limits of `validation/tolerances.toml`, once for all pairs."""
    table: dict[str, Any] = TOML.read(Shipped.TOLERANCE_FILE)["closed-loop"]
    return table


@dataclass(frozen=True)
class Agreement(JSONRecord):
    """The differences of a plant from the reference plant, with a verdict if their limits are known.

    Parameters
    ----------
    scenario, controller, plant, reference, drive : str
        What was run, and the plant that it is compared with.
    max_load_error_m, max_angle_error_rad : float
        Largest difference of the load's position [m] and of the two cardan angles [rad].
    limit_m, limit_rad : float or None
        Limits of these differences, None if they are unknown.
    passed : bool or None
        Whether the plants agree; None if they are not judged.
    limits : str
        Where the limits come from, or why there are none.
    curing_step_s : float or None
        A shorter `control.physics_step` [s] with which they agree.
    """

    scenario: str
    controller: str
    plant: str
    reference: str
    drive: str
    max_load_error_m: float
    max_angle_error_rad: float
    limit_m: float | None
    limit_rad: float | None
    passed: bool | None
    limits: str
    curing_step_s: float | None = None

    def __post_init__(self) -> None:
        """Raise InconsistentError for plants that pass although they exceed a limit."""
        if self.passed:
            load, angle = self.max_load_error_m, self.max_angle_error_rad
            InconsistentError.check_ascending(
                ("the difference of a load that passed", load), ("its limit", self.limit_m)
            )
            InconsistentError.check_ascending(
                ("the difference of an angle that passed", angle), ("its limit", self.limit_rad)
            )

    @property
    def excess(self) -> float:
        """The larger difference over its limit, infinite where it is NaN; NaN without limits."""
        if self.limit_m is None or self.limit_rad is None:
            return math.nan
        ratios = self.max_load_error_m / self.limit_m, self.max_angle_error_rad / self.limit_rad
        return math.inf if any(map(math.isnan, ratios)) else max(ratios)

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        return "not judged" if self.passed is None else "passed" if self.passed else "FAILED"

    @staticmethod
    def pairs(runs: Sequence[Run], plants: Iterable[str] = ()) -> list[tuple[Run, Run]]:
        """Pair every other run with that of the reference plant, which comes second.

        The reference plant is chosen among `plants`, by default those of `runs`.
        """
        reference = PLANTS.reference(plants or [run.plant for run in runs])
        return [(a, b) for b in runs if b.plant == reference for a in runs if a.plant != reference]

    @classmethod
    def judge_steps(
        cls, runs: Sequence[Run], limits: AgreementLimits | NoLimits, progress: Progress | None = None
    ) -> "Agreement":
        """Judge as `judge` does; if the plants differ too much, find a physics step with which they agree.

        The order of the difference gives the step, and new runs confirm it. There is no search if the memory
        does not suffice or a run was interrupted.
        """
        agreement = judge(*runs, limits=limits)
        if agreement.passed is not False or not isinstance(limits, AgreementLimits):
            return agreement
        interrupted = any(run.status == RunStatus.INTERRUPTED for run in runs)
        one = runs[0]
        if interrupted or not 1.0 < agreement.excess < math.inf:
            return agreement
        if not RunMemory(one.scenario).fits(one.design, one.drive, runs=2 * len(runs)):
            return agreement  # the memory does not suffice for finer runs beside these
        # The difference falls with the step to the power of `order`.
        halvings = min(math.ceil(math.log2(agreement.excess) / limits.order), MAX_HALVINGS)
        shorter = PhysicsStep(one.scenario, one.drive).refined(2**halvings)
        if shorter is None:
            return agreement
        finer_runs = []
        for run in runs:
            finer = simulate_run(
                shorter, plant=run.plant, drive=run.drive, design=run.design, progress=progress
            )
            if finer.status == RunStatus.INTERRUPTED:
                return agreement
            finer_runs.append(finer)
        if not judge(*finer_runs, limits=limits).passed:
            return agreement
        return replace(agreement, curing_step_s=shorter.control.physics_step)

    @staticmethod
    def worst(agreements: "Sequence[Agreement]") -> "Agreement":
        """Return the first agreement that fails, else the first that is not judged, else the first."""
        return min(
            agreements, key=lambda agreement: (agreement.passed is not False, agreement.passed is True)
        )


@Arguments.checked
def judge(
    a: Run, b: Run, *, limits: AgreementLimits | NoLimits | None = None, comparison: Comparison | None = None
) -> Agreement:
    """Judge the agreement of two plants.

    Plants do not agree if their runs end with a different status, or at times that differ by more than the
    limit. Without limits for this pair there is no verdict.

    Parameters
    ----------
    a, b : Run
        The run of a plant, and that of the reference plant.
    limits : AgreementLimits or NoLimits, optional
        Limits; by default those that cranectl has for the scenario.
    comparison : Comparison, optional
        The comparison of the two, if it has been computed already.

    Returns
    -------
    Agreement
        The differences and the verdict.
    """
    comparison = comparison or compare_runs(a, b, signals=())
    limits = limits or pair_limits(a.scenario, a.drive, (a.plant, b.plant))
    known = limits if isinstance(limits, AgreementLimits) else None
    return Agreement(
        scenario=a.scenario.name,
        controller=a.design.name,
        plant=a.plant,
        reference=b.plant,
        drive=a.drive,
        max_load_error_m=comparison.max_load_error_m,
        max_angle_error_rad=comparison.max_angle_error_rad,
        limit_m=known.load_m if known else None,
        limit_rad=known.angle_rad if known else None,
        passed=_within(comparison, a, b, known) if known else None,
        limits=TOLERANCES if isinstance(limits, AgreementLimits) else limits.reason,
    )


def _within(comparison: Comparison, a: Run, b: Run, limits: AgreementLimits) -> bool:
    return (
        comparison.max_load_error_m <= limits.load_m
        and comparison.max_angle_error_rad <= limits.angle_rad
        and abs(a.end_ns - b.end_ns) <= limits.end_s * NANOSECONDS
        and a.status == b.status
    )
