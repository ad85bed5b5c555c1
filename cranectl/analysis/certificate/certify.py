"""The robustness certificate: nu-gap of the plant as it is run to the design model, against b(G, K).

A point is certified if its nu-gap lies below the margin b by more than the grid resolves or, which asks less,
if at each frequency the chordal distance lies below the margin of the loop at that frequency. The linear loop
frozen at that point is then stable. It says nothing of the motion between points.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from cranectl.analysis.certificate.linear_plant import linear_plant
from cranectl.analysis.certificate.loop import (
    InnerLoop,
    Opening,
    choose_opening,
    closed_loop_radius,
    design_inner_loop,
    inner_loop_of,
)
from cranectl.analysis.certificate.nu_gap import (
    CoprimeMargin,
    Graph,
    NuGap,
    coprime_margin,
    largest_excess,
    nu_gap,
)
from cranectl.analysis.certificate.operating_points import OperatingPoint
from cranectl.analysis.certificate.systems import RESOLUTION
from cranectl.design import Design
from cranectl.plants.plant import Drive
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.simulate import tracker_of
from cranectl.support.errors import InputError

MOST_DELAY_SAMPLES = 300  # a point takes 2 s then, and no controller here bears half as much
CAUTION = 2.0 * RESOLUTION  # gap and margin are each found to within the resolution of the grid

# gap: nu-gap below b; by frequency: distance below margin at each frequency.
Grade = Literal["gap", "by frequency", "refused"]


@dataclass(frozen=True)
class NominalLoop:
    """What a controller's plants are compared with; the same at every point."""

    design: Design
    opening: Opening
    period: float  # [s]
    graph: Graph  # of the design model
    margin: CoprimeMargin

    def inner_loop(self, scenario: Scenario, point: OperatingPoint, drive: Drive) -> InnerLoop:
        """The plant of `scenario` frozen at `point`, under the design's state feedback."""
        return inner_loop_of(linear_plant(scenario, point, drive), self.design.gain)

    def judge(self, inner: InnerLoop, point: OperatingPoint) -> "PointVerdict":
        """Compare the plant frozen at `point`."""
        graph = self.opening.graph(inner)
        gap = nu_gap(graph, self.graph)
        return PointVerdict(
            point=point,
            gap=gap.gap,
            frequency=gap.angle / self.period,
            grade=self.grade(graph, gap),
            closed_loop_radius=closed_loop_radius(inner, self.opening.robustifier),
        )

    def certifies(self, inner: InnerLoop) -> bool:
        """Whether the loop around `inner` is known to be stable."""
        graph = self.opening.graph(inner)
        return self.grade(graph, nu_gap(graph, self.graph)) != "refused"

    def grade(self, graph: Graph, gap: NuGap) -> Grade:
        """What the plant of this `graph` and `gap` to the design model deserves."""
        if gap.gap + CAUTION < self.margin.margin:
            return "gap"
        if gap.winding != 0 or self.margin.margin <= 0.0:
            return "refused"
        controller, poles = self.opening.controller, self.opening.robustifier.poles()
        excess = largest_excess(graph, self.graph, controller, poles)
        return "by frequency" if excess + CAUTION < 0.0 else "refused"


@dataclass(frozen=True)
class PointVerdict:
    """One operating point."""

    point: OperatingPoint
    gap: float
    frequency: float  # of the largest chordal distance [rad/s]
    grade: Grade
    closed_loop_radius: float  # largest modulus of the poles of the true linear loop

    @property
    def certified(self) -> bool:
        """Whether the linear loop is known to be stable from gap and margin alone."""
        return self.grade != "refused"

    @property
    def stable(self) -> bool:
        """Whether the linear loop is stable; not what the certificate is made from."""
        return self.closed_loop_radius < 1.0

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        fields = asdict(self)
        return {**fields.pop("point"), **fields}


@dataclass(frozen=True)
class Certificate:
    """All points of one controller."""

    controller: str
    drive: Drive
    delay: float  # [s]
    time_constants: tuple[float, float, float]  # of the drives [s]
    opening: Opening
    margin: float  # b(G, K)
    margin_frequency: float  # [rad/s]
    points: tuple[PointVerdict, ...]

    @property
    def worst(self) -> PointVerdict:
        """The point of the largest nu-gap."""
        return max(self.points, key=lambda verdict: verdict.gap)

    @property
    def certified(self) -> bool:
        """Whether every point is."""
        return all(verdict.certified for verdict in self.points)

    def to_json(self) -> dict[str, Any]:
        """Plain data, SI units and rad/s."""
        return {
            "controller": self.controller,
            "drive": self.drive,
            "delay": self.delay,
            "time_constants": list(self.time_constants),
            "opened_at": self.opening.name,
            "scales": self.opening.scales.tolist(),
            "margin": self.margin,
            "margin_frequency": self.margin_frequency,
            "certified": self.certified,
            "least_margin": self.margin - self.worst.gap,
            "worst": self.worst.to_json(),
            "points": [verdict.to_json() for verdict in self.points],
        }


def make_nominal_loop(scenario: Scenario, design: Design, opened_at: str | None = None) -> NominalLoop:
    """Design model and margin of `design` with the loop opened at a signal, see `choose_opening`.

    Raises InputError for a signal at which it cannot be, and for a long delay.
    """
    samples = scenario.delay_samples
    if samples > MOST_DELAY_SAMPLES:
        raise InputError(
            f"a delay of {samples} control periods, each of them three states of the linear loop",
            allowed=f"at most {MOST_DELAY_SAMPLES}",
            remedy="'cranectl run' simulates any delay; no loop is certified with one like this",
        )
    tracker_of(scenario, design)  # raises if the design's own loop is unstable when sampled
    period = scenario.period_ns / NANOSECONDS
    opening = choose_opening(design, scenario.design, period, opened_at)
    graph = opening.graph(design_inner_loop(design.gain, period))
    margin = coprime_margin(graph, opening.controller, opening.robustifier.poles())
    return NominalLoop(design, opening, period, graph, margin)


def certify(
    nominal_loop: NominalLoop,
    scenario: Scenario,
    points: Sequence[OperatingPoint],
    *,
    drive: Drive,
    progress: Callable[[float], None] | None = None,
) -> Certificate:
    """Judge a controller at every point; drives, delay and observer are those of `scenario`.

    Raises InputError for force drives, whose loop is not linearised.
    """
    if drive == "force":
        raise InputError(
            "a certificate of force drives",
            allowed="ideal or velocity drives",
            remedy="take '--drive velocity'",
        )
    verdicts = []
    for point in points:
        verdicts.append(nominal_loop.judge(nominal_loop.inner_loop(scenario, point, drive), point))
        if progress is not None:
            progress(1.0)
    lag_x, lag_y, lag_l = (float(lag) for lag in scenario.rig.time_constants)
    delay = scenario.effects.delay
    return Certificate(
        controller=nominal_loop.design.name,
        drive=drive,
        delay=delay.seconds if delay else 0.0,
        time_constants=(lag_x, lag_y, lag_l),
        opening=nominal_loop.opening,
        margin=nominal_loop.margin.margin,
        margin_frequency=nominal_loop.margin.angle / nominal_loop.period,
        points=tuple(verdicts),
    )
