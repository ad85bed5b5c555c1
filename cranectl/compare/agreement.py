"""Whether plants agree: how far they may differ, of which scenarios and plants that is known, and a verdict.

Ideal and force drives (level 2), and velocity drives that feel the load (level 3), are statements about
numerics, and hold for any scenario, law and rig. How far a drive that is blind to the load, the analytic lag,
is from those that feel it depends on rig, motion and controller: the limits of `validation/tolerances.toml`
hold for the shipped scenarios with their own rig, others are predicted along their own run.
"""

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from cranectl.compare.runs import Comparison, compare_runs
from cranectl.controllers.controller import LawDesign
from cranectl.design import Design
from cranectl.plants.registry import plant_entry, reference_plant
from cranectl.reference.planning.limits import share_of
from cranectl.scenario import NANOSECONDS, Scenario, read_scenario, scenario_names
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.segments import as_asked
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support import resources
from cranectl.support.documents import read_toml

ORDER = 4  # of the engine's scheme, the lower one of both plants
MOST_HALVINGS = 4
SHORTEST_NS = 1000  # of control.physics_step

Progress = Callable[[float], None]  # called with the simulated seconds since the last call

# Fields of a scenario that move neither plant.
SILENT = {"name", "title", "controller", "expected", "log", "metrics", "limits"}


@dataclass(frozen=True)
class Limits:
    """How far two plants may differ, and why."""

    load_m: float
    angle_rad: float
    end_s: float  # between the ends of runs that stop early
    reason: str
    source: str = "validation/tolerances.toml"


@dataclass(frozen=True)
class NoLimits:
    """Nobody knows how far the plants may differ: their difference is reported, not judged."""

    reason: str


# Of velocity drives that feel the load, and analytic's.
Predict = Callable[[Scenario, Design], Limits | NoLimits]
PairLimits = Mapping[tuple[str, str], Limits | NoLimits]  # by a plant and the one it is compared against

OTHER_PAIR = NoLimits("with velocity drives limits are known for drives that feel the load, and analytic's")
OTHER_LAW = NoLimits("how far the analytic plant's velocity drives lead is known for the flat family only")
ENCODERS = NoLimits(
    "beside an effect whose schemes differ an encoder now and then reads one step more on one plant, and a "
    "loop that is hardly stable makes any size of that"
)
SMOOTHED = NoLimits(
    "Coulomb's friction of the joint is a smoothed sign in the analytic plant, which never sticks"
)
NOT_SHIPPED = NoLimits(
    "how far the analytic plant's velocity drives lead is known for the shipped scenarios and their own rig; "
    "--predict finds the bound of this one"
)


def limits_for(
    scenario: Scenario,
    design: Design | LawDesign,
    drive: str,
    plants: Iterable[str],
    *,
    predict: Predict | None = None,
) -> PairLimits:
    """The limits of each of `plants` and the one that they are compared against, as `pair_limits`."""
    plants = list(plants)
    reference = reference_plant(plants)
    return {
        (plant, reference): pair_limits(scenario, design, drive, (plant, reference), predict=predict)
        for plant in plants
        if plant != reference
    }


def pair_limits(
    scenario: Scenario,
    design: Design | LawDesign,
    drive: str,
    pair: tuple[str, str],
    *,
    predict: Predict | None = None,
) -> Limits | NoLimits:
    """The limits of two plants; where the shipped ones do not hold for the analytic one, by `predict`."""
    if drives_agree(drive, pair):
        alike = agreement_limits("ideal" if drive == "velocity" else drive)
        return _with_effects(alike, scenario, drive, pair)
    if "analytic" not in pair or not any(plant_entry(plant).servos for plant in pair):
        return OTHER_PAIR
    if not isinstance(design, Design):
        return OTHER_LAW
    name = shipped_name(scenario)
    if name is not None:
        return agreement_limits(drive, name)
    return predict(scenario, design) if predict is not None else NOT_SHIPPED


def drives_agree(drive: str, plants: Iterable[str]) -> bool:
    """Whether the drives of `plants` obey the same equations: velocity drives, if all of them are servos."""
    return drive != "velocity" or all(plant_entry(plant).servos for plant in plants)


@functools.cache
def agreement_limits(drive: str, scenario: str = "") -> Limits:
    """What two plants with these drives may differ in closed loop.

    With velocity drives of which one is blind to the load in the shipped `scenario`; one on a rig of its own
    has limits of its own.
    """
    shared = dict(_closed_loop()[drive])
    own = shared.pop("scenarios", {}).get(scenario, {})
    return Limits(**{**shared, **own})


@functools.cache
def _closed_loop() -> dict[str, Any]:
    """The limits of `validation/tolerances.toml`, read once for all pairs."""
    found: dict[str, Any] = read_toml(resources.TOLERANCE_FILE)["closed-loop"]
    return found


def _with_effects(limits: Limits, scenario: Scenario, drive: str, pair: tuple[str, str]) -> Limits | NoLimits:
    """What the schemes of effects leave besides; lengths are those of the laboratory's rig."""
    known = _closed_loop()["effects"]
    if scenario.effects.sensing and len(known.keys() & set(scenario.effects.names)) > 1:
        return ENCODERS
    friction = scenario.effects.friction
    if friction and friction.pivot_coulomb and "analytic" in pair:
        return SMOOTHED
    size = scenario.rig.rope_range[1] / RigParameters().rope_range[1]
    for name in scenario.effects.names:
        found = known.get(name, {})
        found = {**found, **found.get(drive, {})}
        if found:
            limits = replace(
                limits,
                load_m=max(limits.load_m, max(size, 1.0) * found["load_m"]),
                angle_rad=max(limits.angle_rad, found["angle_rad"]),
                reason=found["reason"],
            )
    return limits


def shipped_name(scenario: Scenario) -> str | None:
    """The scenario that comes with cranectl and moves the plants as `scenario` does, on the same rig."""
    motion = _motion(scenario)
    return next((name for name, shipped in _shipped_motions().items() if shipped == motion), None)


@functools.cache
def _shipped_motions() -> dict[str, dict[str, Any]]:
    return {name: _motion(read_scenario(name)) for name in scenario_names()}


def _motion(scenario: Scenario) -> dict[str, Any]:
    motion = scenario.model_dump(exclude=SILENT)
    motion["planning"]["share"] = share_of(scenario)
    motion["reference"]["segments"] = [
        asked for segment in scenario.reference.segments for asked in as_asked(segment)
    ]
    return motion


@dataclass(frozen=True)
class Agreement:
    """A comparison of a plant with the reference plant, judged where their limits are known."""

    scenario: str
    controller: str
    plant: str
    reference: str
    drive: str
    max_load_error_m: float
    max_angle_error_rad: float
    limit_m: float | None
    limit_rad: float | None
    passed: bool | None  # None: not judged
    limits: str  # where the limits come from, or why there are none
    curing_step_s: float | None = None  # control.physics_step with which they were seen to agree after all

    @property
    def verdict(self) -> str:
        """In words."""
        return "not judged" if self.passed is None else "passed" if self.passed else "FAILED"

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def against_reference(runs: Sequence[Run], plants: Iterable[str] = ()) -> list[tuple[Run, Run]]:
    """Every other run with that of the reference plant, which comes second; none where that is missing.

    `plants`: those that the reference is of, by default those of `runs`.
    """
    reference = reference_plant(plants or [run.plant for run in runs])
    return [(a, b) for b in runs if b.plant == reference for a in runs if a.plant != reference]


def judge(
    a: Run, b: Run, *, limits: Limits | NoLimits | None = None, comparison: Comparison | None = None
) -> Agreement:
    """Judge the agreement of two plants by `limits`, by default those that cranectl has for their scenario.

    Plants that ended with different status, or at times further from each other than the limit, do not agree,
    whatever their difference. Without limits of this pair there is no verdict. `comparison`: of the two,
    where it is known already.
    """
    comparison = comparison or compare_runs(a, b, signals=())
    limits = limits or pair_limits(a.scenario, a.design, a.drive, (a.plant, b.plant))
    known = limits if isinstance(limits, Limits) else None
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
        limits=limits.source if isinstance(limits, Limits) else limits.reason,
    )


def all_pairs(runs: Sequence[Run]) -> list[tuple[Run, Run]]:
    """Every run with every other; where the reference plant is one of them, it comes second."""
    pairs = itertools.combinations(runs, 2)
    reference = reference_plant(run.plant for run in runs)
    return [(b, a) if a.plant == reference else (a, b) for a, b in pairs]


def least_good(agreements: Sequence[Agreement]) -> Agreement:
    """The first that does not hold, else the first that is not judged, else the first."""
    return min(agreements, key=lambda agreement: (agreement.passed is not False, agreement.passed is True))


def _within(comparison: Comparison, a: Run, b: Run, limits: Limits) -> bool:
    return (
        comparison.max_load_error_m <= limits.load_m
        and comparison.max_angle_error_rad <= limits.angle_rad
        and abs(a.end_ns - b.end_ns) <= limits.end_s * NANOSECONDS
        and a.status == b.status
    )


def ended_as_expected(run: Run) -> bool:
    """Whether `run` ended as its scenario says that runs must."""
    return run.status.label == run.scenario.expected


def judge_steps(
    runs: Sequence[Run], limits: Limits | NoLimits, progress: Progress | None = None
) -> Agreement:
    """As `judge`; where plants differ too much but for their drives, with the step that cures it.

    The step is as short as the order of the scheme says, and tried: both plants run once more. None if they
    differ even then. An interrupt ends that, not the verdict.
    """
    agreement = judge(*runs, limits=limits)
    same = drives_agree(agreement.drive, (agreement.plant, agreement.reference))
    if not same or agreement.passed is not False or not isinstance(limits, Limits):
        return agreement
    excess = max(agreement.max_load_error_m / limits.load_m, agreement.max_angle_error_rad / limits.angle_rad)
    if not 1.0 < excess < math.inf or any(run.status == RunStatus.INTERRUPTED for run in runs):
        return agreement
    halvings = min(math.ceil(math.log2(excess) / ORDER), MOST_HALVINGS)
    shorter = with_finer_steps(runs[0].scenario, 2**halvings)
    if shorter is None or not _agree(shorter, runs, limits, progress):
        return agreement
    return replace(agreement, curing_step_s=shorter.control.physics_step)


def _agree(scenario: Scenario, runs: Sequence[Run], limits: Limits, progress: Progress | None) -> bool:
    """Whether the plants of `runs` agree in `scenario`."""
    again: list[Run] = []
    for run in runs:
        again.append(
            simulate_run(scenario, plant=run.plant, drive=run.drive, design=run.design, progress=progress)
        )
        if again[-1].status == RunStatus.INTERRUPTED:
            return False
    return judge(*again, limits=limits).passed is True


def with_finer_steps(scenario: Scenario, times: int) -> Scenario | None:
    """`scenario` with so many times as many steps, unless that is off the grid of nanoseconds."""
    step_ns, rest = divmod(scenario.period_ns, scenario.substeps * times)
    if rest or step_ns < SHORTEST_NS:
        return None
    control = scenario.control.model_copy(update={"physics_step": step_ns / NANOSECONDS})
    return scenario.model_copy(update={"control": control})
