"""Recommend a controller for given drives and sensors, and the hardware to improve first.

A controller is guaranteed if the certificate holds at every operating point that the scenario visits. It
holds if the linear loop at that fixed point is stable. A controller has survived if its run completed. The
cost is measured: the distance of the load from its position in the continuous-time ideal.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from cranectl.analysis.certificate.certify import Certificate, PointVerdict, certify, make_nominal_loops
from cranectl.analysis.certificate.operating_points import OperatingPoint, grid_of
from cranectl.analysis.continuous import simulate_continuous
from cranectl.analysis.ladder import Size, deviation
from cranectl.analysis.levels import with_effects
from cranectl.design import CONTROLLERS, design_controller
from cranectl.metrics import RunMetrics, run_metrics
from cranectl.scenario import EFFECTS, NANOSECONDS, Scenario
from cranectl.signals import ROPE, ROPE_RATE
from cranectl.simulate import Plan, simulate_run
from cranectl.status import RunStatus
from cranectl.support import merged

IMPROVEMENTS = 5  # number of improvements that are tried
DRIVE_AND_SENSOR_EFFECTS = [name for name, kind in EFFECTS.items() if kind.is_staged and kind.adds]
STILL = 0.02  # [m/s], below which the rope counts as still
Progress = Callable[[float], None]  # called with one for each controller and improvement


@dataclass(frozen=True)
class Assessment:
    """The results of one controller on the present rig."""

    controller: str
    certificate: Certificate
    status: RunStatus
    metrics: RunMetrics | None
    cost: Size | None  # from the continuous-time ideal; None for a run without samples

    @property
    def guaranteed(self) -> bool:
        """Whether every operating point is certified."""
        return self.certificate.certified

    @property
    def survived(self) -> bool:
        """Whether the run completed."""
        return self.status == RunStatus.COMPLETED

    @property
    def least_margin(self) -> float:
        """Smallest remaining stability margin over all points; positive if the controller is guaranteed."""
        return self._tightest.left

    @property
    def judged_by(self) -> str:
        """How the certificate judges that point: by the gap alone, frequency by frequency, or refused."""
        return {"gap": "gap", "by frequency": "frequency", "refused": "refused"}[self._tightest.grade]

    @property
    def _tightest(self) -> PointVerdict:
        return min(self.certificate.points, key=lambda point: point.left)

    @property
    def grade(self) -> str:
        """Grade of the controller: failed, survived or guaranteed."""
        if not self.survived:
            return "failed"
        return "guaranteed" if self.guaranteed else "survived"

    def to_json(self) -> dict[str, Any]:
        return {
            "controller": self.controller,
            "grade": self.grade,
            "status": self.status.label,
            "least_margin": self.least_margin,
            "judged_by": self.judged_by,
            "margin": self.certificate.margin,
            "worst": str(self.certificate.worst.point),
            "metrics": self.metrics.to_json() if self.metrics else None,
            "cost": asdict(self.cost) if self.cost else None,
        }


@dataclass(frozen=True)
class Improvement:
    """A rig with one improved property, under the recommended controller."""

    name: str
    change: str
    gain: float  # fraction by which it reduces the RMS cost; negative if it increases the cost
    assessment: Assessment

    def to_json(self) -> dict[str, Any]:
        return {**vars(self), "assessment": self.assessment.to_json()}


@dataclass(frozen=True)
class Advice:
    """All controllers on one rig, the best first, and the improvements, the most useful first."""

    scenario: Scenario
    points: tuple[OperatingPoint, ...]
    assessments: tuple[Assessment, ...]
    improvements: tuple[Improvement, ...]

    @property
    def best(self) -> Assessment | None:
        """The recommended controller; None if no controller survives."""
        return self.assessments[0] if self.assessments[0].survived else None

    def to_json(self) -> dict[str, Any]:
        return {
            "scenario": self.scenario.name,
            "effects": list(self.scenario.effects.names),
            "recommended": self.best.controller if self.best else None,
            "points": [str(point) for point in self.points],
            "assessments": [assessment.to_json() for assessment in self.assessments],
            "improvements": [improvement.to_json() for improvement in self.improvements],
        }


def advise(
    scenario: Scenario, controllers: Sequence[str] = CONTROLLERS, *, progress: Progress | None = None
) -> Advice:
    """Assess the controllers with velocity drives and DRIVE_AND_SENSOR_EFFECTS, as set or by default."""
    rig = with_effects(scenario, {*DRIVE_AND_SENSOR_EFFECTS, *scenario.effects.names})
    points = tuple(visited_points(rig))
    assessments = []
    for name in controllers:
        assessments.append(assess(rig, name, points))
        if progress is not None:
            progress(1.0)
    assessments.sort(key=_rank)
    best = assessments[0]
    improvements = []
    for name, change, better in improved(rig) if best.survived else []:
        after = assess(better, best.controller, points)
        improvements.append(Improvement(name, change, _saved(best, after), after))
        if progress is not None:
            progress(1.0)
    improvements.sort(key=lambda improvement: -improvement.gain)
    return Advice(rig, points, tuple(assessments), tuple(improvements))


def assess(scenario: Scenario, controller: str, points: Sequence[OperatingPoint]) -> Assessment:
    """Certify `controller` at `points` and run it on the engine's rig."""
    design = design_controller(controller, scenario.design)
    certificate = certify(make_nominal_loops(scenario, design, points), scenario, points, drive="velocity")
    run = simulate_run(scenario, plant="mujoco", drive="velocity", design=design)
    ideal = simulate_continuous(scenario, design)
    return Assessment(controller, certificate, run.status, run_metrics(run), deviation(run, ideal))


def visited_points(scenario: Scenario) -> list[OperatingPoint]:
    """Return the extreme operating points of a scenario: rope lengths, hoisting speeds, disturbances."""
    plan = Plan.of(scenario)
    length, rate = plan.reference_state[:, ROPE], plan.reference_state[:, ROPE_RATE]
    lengths = sorted({round(float(value), 3) for value in (length.min(), length.max())})
    low, high = scenario.rig.rope_range
    speeds = {round(float(value), 3) for value in (rate.min(), rate.max()) if abs(value) > STILL}
    edges = np.flatnonzero(np.any(np.diff(plan.disturbance, axis=0), axis=1)) + 1
    rows = plan.disturbance[[0, *edges]]
    # Gravity cannot hold a steady tilt against stronger disturbances on the longest rope.
    limit = 0.7 * scenario.rig.gravity / lengths[-1]
    tilts = {(float(alpha), float(beta)) for alpha, beta in rows if float(np.hypot(alpha, beta)) < limit}
    return grid_of(
        scenario,
        rope_lengths=[min(max(value, low), high) for value in lengths],
        tilts=sorted(tilts),
        hoisting_speeds=sorted({0.0, *speeds}),
    )


def improved(scenario: Scenario) -> list[tuple[str, str, Scenario]]:
    """Return (name, change, scenario) for each hardware property made twice as good."""
    effects, rig, control = scenario.effects, scenario.rig, scenario.control
    assert effects.sensing is not None
    assert effects.delay is not None
    lags = [f"{axis}_time_constant" for axis in ("bridge", "trolley", "winch")]
    half, step = round(0.5 * scenario.period_ns) / NANOSECONDS, control.physics_step
    delay = round(0.5 * effects.delay.seconds / control.period) * control.period
    sensing = effects.sensing
    changes: list[tuple[str, str, dict[str, Any]]] = [
        (
            "servos",
            f"time constants {_list(1e3 * rig.time_constants)} to {_list(5e2 * rig.time_constants)} ms",
            {"rig": {name: 0.5 * getattr(rig, name) for name in lags}},
        ),
        (
            "sampling",
            f"period {1e3 * control.period:g} to {1e3 * half:g} ms",
            {"control": {"period": half, "physics_step": step and min(half, step)}},
        ),
        (
            "delay",
            f"{1e3 * effects.delay.seconds:g} to {1e3 * delay:g} ms",
            {"effects": {"delay": {"seconds": delay}}},
        ),
        (
            "encoders",
            "half the resolution and the noise",
            {"effects": {"sensing": {
                "position_resolution": [0.5 * value for value in sensing.position_resolution],
                "angle_resolution": 0.5 * sensing.angle_resolution,
                "position_noise": [0.5 * value for value in sensing.position_noise],
                "angle_noise": 0.5 * sensing.angle_noise,
            }}},
        ),
        (
            "observer",
            f"bandwidth {sensing.observer_bandwidth:g} to {2.0 * sensing.observer_bandwidth:g} rad/s",
            {"effects": {"sensing": {"observer_bandwidth": min(2.0 * sensing.observer_bandwidth, 1000.0)}}},
        ),
    ]  # fmt: skip
    table = scenario.model_dump(mode="json", exclude_none=True)
    return [
        (name, change, Scenario.from_table(merged(table, new), f"{scenario.name}, better {name}"))
        for name, change, new in changes
    ]


def _rank(assessment: Assessment) -> tuple[bool, bool, float]:
    error = assessment.metrics.rms_error_m if assessment.metrics else np.inf
    return not assessment.survived, not assessment.guaranteed, error


def _saved(before: Assessment, after: Assessment) -> float:
    if before.cost is None or after.cost is None or not after.survived or not before.cost.rms:
        return -np.inf
    return 1.0 - after.cost.rms / before.cost.rms


def _list(values: Sequence[float] | np.ndarray) -> str:
    """Return one number such as `20`, or all of them, `20, 20, 30`, if they differ."""
    texts = [f"{value:g}" for value in values]
    return texts[0] if all(a == b for a, b in pairwise(texts)) else ", ".join(texts)
