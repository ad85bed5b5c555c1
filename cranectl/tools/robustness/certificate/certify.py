"""Certify robust stability: compare the nu-gap of plant and design model with the coprime margin b(G, K).

There are two sufficient conditions. The nu-gap lies below the margin b by more than the grid resolves. Or, as
a weaker condition, the chordal distance lies below the margin of the loop at each frequency. Then the loop
linearised at that operating point is stable. The certificate says nothing about the motion between points.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from cranectl.controllers import ALL_CONTROLLERS, LinearController, Tracker
from cranectl.design import ControllerDesign
from cranectl.plants import DRIVES, Drive, MujocoPlant
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.simulate import PreparedController
from cranectl.support import InconsistentError, InputError
from cranectl.tools.robustness.certificate.linear_plant import LinearPlant
from cranectl.tools.robustness.certificate.loop import AxisDesign, InnerLoop, Opening
from cranectl.tools.robustness.certificate.nu_gap import CoprimeMargin, Graph, NuGap, largest_excess
from cranectl.tools.robustness.certificate.operating_points import OperatingPoint
from cranectl.tools.robustness.certificate.systems import RESOLUTION

MAX_DELAY_SAMPLES = 300  # a point then takes 2 s; no controller here is stable with half of this delay
UNIT_ROUNDING = 1e-9  # of a distance or margin that lies between zero and one
REQUIRED_MARGIN = 2.0 * RESOLUTION  # gap and margin each have an error of up to RESOLUTION

# gap: nu-gap below b; by frequency: distance below margin at each frequency.
Grade = Literal["gap", "by frequency", "refused"]


@dataclass(frozen=True)
class NominalLoop:
    """The loop of a controller with its design model, the reference of all comparisons."""

    design: ControllerDesign
    opening: Opening
    graph: Graph  # of the design model
    margin: CoprimeMargin

    @property
    def period(self) -> float:
        """Control period [s]."""
        return self.opening.axis.period

    def plant(
        self, scenario: Scenario, point: OperatingPoint, drive: Drive, plant: MujocoPlant | None = None
    ) -> LinearPlant:
        """Linearise the plant of `scenario`, or `plant`, at `point`, with the outputs of this controller."""
        return LinearPlant.of(scenario, point, drive, plant=plant, flat=self.design.axis_design is not None)

    def close(self, plant: LinearPlant) -> InnerLoop:
        """Close a linear plant with the design's state feedback."""
        return InnerLoop.of(plant, self.opening.axis.gain)

    def inner_loop(self, scenario: Scenario, point: OperatingPoint, drive: Drive) -> InnerLoop:
        """Return the plant of `scenario` at `point`, closed with the design's state feedback."""
        return self.close(self.plant(scenario, point, drive))

    def judge(self, inner: InnerLoop, point: OperatingPoint) -> "PointVerdict":
        """Compare the plant linearised at `point` with the design model."""
        graph = self.opening.graph(inner)
        gap = NuGap.between(graph, self.graph)
        grade, left = self.grade(graph, gap)
        return PointVerdict(
            point=point,
            margin=self.margin.margin,
            margin_frequency=self.margin.frequency / self.period,
            gap=gap.gap,
            frequency=gap.frequency / self.period,
            grade=grade,
            left=left,
            closed_loop_radius=inner.closed_loop_radius(self.opening.axis.robustifier),
        )

    def certifies(self, inner: InnerLoop) -> bool:
        """Return True if the loop around `inner` is proven to be stable."""
        graph = self.opening.graph(inner)
        return self.grade(graph, NuGap.between(graph, self.graph))[0] != "refused"

    def grade(self, graph: Graph, gap: NuGap) -> tuple[Grade, float]:
        """Return the grade of a plant with this `graph` and `gap`, and its remaining margin."""
        left = self.margin.margin - gap.gap
        if left > REQUIRED_MARGIN:
            return "gap", left
        if gap.winding != 0 or self.margin.margin <= 0.0:
            return "refused", left
        controller, poles = self.opening.controller, self.opening.axis.robustifier.poles()
        left = max(left, -largest_excess(graph, self.graph, controller, poles))
        return ("by frequency" if left > REQUIRED_MARGIN else "refused"), left


@dataclass(frozen=True)
class PointVerdict:
    """The verdict on one operating point."""

    point: OperatingPoint
    margin: float  # b(G, K)
    margin_frequency: float  # [rad/s]
    gap: float
    frequency: float  # of the largest chordal distance [rad/s]
    grade: Grade
    left: float  # remaining margin: b minus gap or, for the other grades, the least one over frequency
    closed_loop_radius: float  # largest modulus of the poles of the true linear loop

    def __post_init__(self) -> None:
        """Raise InconsistentError for margins and gaps that contradict each other, or the poles."""
        for name, value in (("the margin", self.margin), ("the nu-gap", self.gap)):
            InconsistentError.check_ascending(
                ("zero", 0.0), (name, value), ("one", 1.0), rounding=UNIT_ROUNDING
            )
        InconsistentError.check_ascending(
            ("what is left of the margin", self.left), ("the margin", self.margin)
        )
        if self.certified:
            InconsistentError.check_ascending(
                ("the largest pole of a certified loop", self.closed_loop_radius), ("one", 1.0)
            )

    @property
    def difference(self) -> float:
        """The margin minus the nu-gap."""
        return self.margin - self.gap

    @property
    def certified(self) -> bool:
        """Whether gap and margin prove that the linear loop is stable."""
        return self.grade != "refused"

    @property
    def stable(self) -> bool:
        """Whether the poles show that the linear loop is stable; the certificate does not use this."""
        return self.closed_loop_radius < 1.0

    def to_json(self) -> dict[str, Any]:
        fields = asdict(self)
        return {**fields.pop("point"), **fields}


@dataclass(frozen=True)
class Certificate:
    """The verdicts on all operating points of one controller."""

    controller: str
    drive: Drive
    delay: float  # [s]
    time_constants: tuple[float, float, float]  # of the drives [s]
    opening: Opening  # at the worst point
    points: tuple[PointVerdict, ...]

    @property
    def worst(self) -> PointVerdict:
        """The point with the smallest difference of margin and nu-gap."""
        return min(self.points, key=lambda verdict: verdict.difference)

    @property
    def margin(self) -> float:
        """The margin b(G, K) at the worst point; in the flat family all points have the same."""
        return self.worst.margin

    @property
    def least_margin(self) -> float:
        """The margin minus the nu-gap at the worst point."""
        return self.worst.difference

    @property
    def certified(self) -> bool:
        """Whether every point is certified."""
        return all(verdict.certified for verdict in self.points)

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data, in SI units and rad/s."""
        return {
            "controller": self.controller,
            "drive": self.drive,
            "delay": self.delay,
            "time_constants": list(self.time_constants),
            "opened_at": self.opening.name,
            "scales": self.opening.scales.tolist(),
            "margin": self.margin,
            "margin_frequency": self.worst.margin_frequency,
            "certified": self.certified,
            "least_margin": self.least_margin,
            "worst": self.worst.to_json(),
            "points": [verdict.to_json() for verdict in self.points],
        }


def make_nominal_loops(
    scenario: Scenario,
    design: ControllerDesign,
    points: Sequence[OperatingPoint],
    opened_at: str | None = None,
) -> dict[float, NominalLoop]:
    """Return the nominal loop of `design` for each rope length of `points`; the flat family has only one.

    Any other controller declares its linearisation for a load that hangs at rest. Raises InputError for a
    controller without one, for other operating points, for fixed axes, and as `make_nominal_loop` does.
    """
    if not all(scenario.rig.moves):
        raise InputError(
            f"a crane with rig.axes = '{scenario.rig.axes}' and rig.rope = '{scenario.rig.rope}'",
            allowed="cranes with three drives: the certificate's model has all of them",
            remedy="judge it by simulation: cranectl ladder, cranectl campaign",
        )
    lengths = list(dict.fromkeys(point.rope_length for point in points))
    if design.axis_design is not None:
        return dict.fromkeys(lengths, make_nominal_loop(scenario, design, opened_at))
    controller = ALL_CONTROLLERS.of_design(design)
    if controller.linearise is None or (controller.command, controller.measures, controller.every) != (
        "acceleration",
        "state",
        1,
    ):
        raise InputError(
            f"'{design.name}' has no linear design of one axis, from state to acceleration once a period",
            allowed="the flat family, and controllers that declare such a linearisation",
            remedy="judge it by simulation: cranectl ladder, cranectl campaign",
        )
    wind = scenario.effects.wind
    if any(point != OperatingPoint(point.rope_length) for point in points) or (wind and any(wind.mean)):
        raise InputError(
            f"the linearisation of {design.name} at a point with tilt, hoisting or wind",
            allowed="a load that hangs at rest, for which the controller declares its linearisation",
            remedy="take --tilt 0 0 and --hoisting-speed 0, and no mean wind",
        )
    linear = PreparedController.near_rest(scenario, design, lengths)
    return {
        controller_at.rope_length: make_nominal_loop(scenario, design, opened_at, controller_at)
        for controller_at in linear
    }


def make_nominal_loop(
    scenario: Scenario,
    design: ControllerDesign,
    opened_at: str | None = None,
    linear: LinearController | None = None,  # of a controller outside the flat family
) -> NominalLoop:
    """Return design model and margin of `design` with the loop opened at a signal, see `choose_opening`."""
    samples = scenario.delay_samples
    if samples > MAX_DELAY_SAMPLES:
        raise InputError(
            f"a delay of {samples} control periods, each of which adds three states to the linear loop",
            allowed=f"at most {MAX_DELAY_SAMPLES}",
            remedy="'cranectl run' simulates any delay; no loop is certified with one like this",
        )
    period = scenario.period_ns / NANOSECONDS
    if linear is not None:
        axis = AxisDesign.of_controller(linear, period)
    else:
        Tracker.of(scenario, design.flat)  # raises if the design's own loop is unstable when sampled
        axis = AxisDesign.of_flat(design.flat, period)
    opening = Opening.choose(design.name, axis, scenario.design, opened_at)
    graph = opening.graph(axis.inner_loop())
    margin = CoprimeMargin.of(graph, opening.controller, axis.robustifier.poles())
    return NominalLoop(design, opening, graph, margin)


def certify(
    nominal_loops: Mapping[float, NominalLoop],
    scenario: Scenario,
    points: Sequence[OperatingPoint],
    *,
    drive: Drive,
    progress: Callable[[float], None] | None = None,
) -> Certificate:
    """Judge a controller at every point, with drives, delay and observer of `scenario`.

    `nominal_loops` are by rope length, see `make_nominal_loops`. Raises InputError for force drives, because
    their loop is not linearised.
    """
    if DRIVES[drive].command == "force":
        raise InputError(
            "a certificate of force drives",
            allowed="ideal or velocity drives",
            remedy="take '--drive velocity'",
        )
    verdicts = []
    for point in points:
        loop = nominal_loops[point.rope_length]
        verdicts.append(loop.judge(loop.inner_loop(scenario, point, drive), point))
        if progress is not None:
            progress(1.0)
    lag_x, lag_y, lag_l = (float(lag) for lag in scenario.rig.time_constants)
    delay = scenario.effects.delay
    worst = min(verdicts, key=lambda verdict: verdict.difference)
    loop = nominal_loops[worst.point.rope_length]
    return Certificate(
        controller=loop.design.name,
        drive=drive,
        delay=delay.seconds if delay else 0.0,
        time_constants=(lag_x, lag_y, lag_l),
        opening=loop.opening,
        points=tuple(verdicts),
    )
