"""Short moves: in the work of a normal move, within their limits, near the bound of the linearised crane."""

import numpy as np
import pytest

from cranectl.planning import load_scenario, minimum_time, programs
from cranectl.planning.checks import MAX_PLANNED
from cranectl.planning.limits import limits_of
from cranectl.planning.minimum_time import SPANS, _thin
from cranectl.planning.plan import plan_move, plan_segments
from cranectl.planning.problem import SAMPLES_PER_SPAN, Problem
from cranectl.planning.programs import MAX_PROGRAMS, ProgramBudget
from cranectl.planning.proof import MAX_PIECES, Proof, Violation, polynomial_pieces, prove
from cranectl.scenario import Scenario
from cranectl.scenario.segments import Move, Spline
from cranectl.support.errors import InputError
from tests.planning.linear_crane import Axis, least_time, longest_distance
from tests.planning.own_crane import evaluate
from tests.planning.tasks import share
from validation.proofs.plan_checks import ALLOWED_EXCESS, ALLOWED_RATIO, CASES, check, load_plan

START = (0.6295, 0.7024, -0.993)
NORMAL = (1.6295, 1.2024, -0.693)
MORE_PROGRAMS = 10  # times those of a normal move, as many as a short one may take


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Count the quadratic programs that are solved, each with about as much work."""
    counts = [0]
    spend = ProgramBudget.spend

    def counted(self: ProgramBudget) -> bool:
        counts[0] += 1
        return spend(self)

    monkeypatch.setattr(ProgramBudget, "spend", counted)
    return counts


def scenario(start: tuple[float, ...], rig: str | None = None) -> Scenario:
    overrides = ["disturbances=[]", "duration=60.0", "reference.segments=[]"]
    return load_scenario("fixed-position", rig=rig, overrides=[*overrides, f"reference.start={list(start)}"])


def planned(start: tuple[float, ...], to: tuple[float, ...], rig: str | None = None) -> Scenario:
    """Return the scenario of a move, planned without what is stored."""
    empty = scenario(start, rig)
    segments = plan_move(Move(kind="move", to=to), np.array(start), empty, "move")
    reference = empty.reference.model_copy(update={"segments": tuple(segments)})
    return empty.model_copy(update={"reference": reference})


@pytest.mark.parametrize(
    ("start", "to", "rig"),
    share(
        [
            (START, (0.6296627, 0.7024, -0.993), None),  # once without an end
            ((25.81223511573401, 20.63636605729395, -38.57),
             (25.820070297851117, 20.63953395541935, -38.565468280834324), "harbour-crane"),  # on the floor
            ((19.973308922265208, 43.57, -23.952667856560044),
             (19.973300277751132, 43.57, -23.952662116827163), "harbour-crane"),  # along an edge
            ((9.79678, 43.57, -37.469), (9.84853, 43.57, -37.46724), "harbour-crane"),
            (START, (0.6295, 0.7024, -0.993001), None),
            (START, (0.629501, 0.7024, -0.993), None),
            (START, (0.6295 + 1e-6 / 3**0.5, 0.7024 - 1e-6 / 3**0.5, -0.993 + 1e-6 / 3**0.5), None),
            (START, (0.6265, 0.7024, -0.991), None),
        ]
    ),
)  # fmt: skip
def test_short_moves_are_planned_in_the_work_of_a_normal_one(
    start: tuple[float, ...], to: tuple[float, ...], rig: str | None, solved: list[int]
) -> None:
    planned(START, NORMAL)
    normal, solved[0] = solved[0], 0
    plan = planned(start, to, rig)
    assert solved[0] <= MORE_PROGRAMS * normal
    (segment,) = plan.reference.segments
    assert isinstance(segment, Spline), "the law of degree 9, a fallback"
    result = check(plan, samples=20_000)
    assert result.excess <= ALLOWED_EXCESS, result
    assert result.misses_end == 0.0
    low, high = np.array(start), np.array(to)
    if np.linalg.norm(high - low) <= 5e-3:
        assert result.duration <= ALLOWED_RATIO * result.linear


@pytest.mark.parametrize("case", share([CASES[3], CASES[13], CASES[8], CASES[22], CASES[23]]))
def test_plans_pass_a_check_by_equations_of_its_own(case: object) -> None:
    """All 25 are checked by `validation/proofs/plan_checks.py`."""
    result = check(load_plan(case), samples=20_000)  # type: ignore[arg-type]
    assert not result.is_wrong, result
    assert result.duration > result.alone


def test_the_check_finds_each_kind_of_mistake() -> None:
    plan = load_plan(CASES[8])
    assert not check(plan, samples=5000).is_wrong
    (segment,) = plan.reference.segments
    assert isinstance(segment, Spline)
    hasty = segment.model_copy(update={"breaks": tuple(0.99 * time for time in segment.breaks)})
    moved = plan.obstacles[0].model_copy(update={"high": (1.2, 1.54, -0.58)})
    aside = segment.model_copy(
        update={"coefficients": tuple((x + 1e-9, y, z) for x, y, z in segment.coefficients)}
    )
    for wrong, limit in (
        (_with(plan, hasty), "acceleration"),
        (plan.model_copy(update={"obstacles": (moved,)}), "box"),
    ):
        result = check(wrong, samples=5000)
        assert result.is_wrong
        assert limit in result.worst
    assert check(_with(plan, aside), samples=5000).misses_end > 1e-10
    narrow = plan.planning.model_copy(update={"lean": 0.2, "tension": (0.9, 1.1)})
    assert check(plan.model_copy(update={"planning": narrow}), samples=5000).excess > 0.1


def _with(plan: Scenario, segment: Spline) -> Scenario:
    reference = plan.reference.model_copy(update={"segments": (segment,)})
    return plan.model_copy(update={"reference": reference})


def test_the_bound_of_the_linearised_crane_is_the_closed_form_where_there_is_one() -> None:
    """A drive without a lag that lifts the load accelerates, drives at full speed, and brakes."""
    for distance, speed, rate in ((1e-6, 9.0, 5.7), (1e-3, 9.0, 0.5), (1.0, 0.57, 5.7)):
        top = min(speed, (distance * rate) ** 0.5)
        least = distance / top + top / rate
        assert least <= least_time(Axis(speed, rate, 0.0), distance) <= 1.001 * least
    swinging = Axis(0.95, 3.8, 0.02, (9.81 / 0.993) ** 0.5)
    distances = [longest_distance(swinging, 0.2, steps) for steps in (80, 160, 320)]
    assert distances[0] < distances[1] < distances[2] < 1.01 * distances[0]


def test_derivatives_of_a_short_motion_far_from_the_origin_are_enclosed_tightly() -> None:
    """Of differences of positions, the fifth derivative of a micrometre would be noise."""
    breaks = np.linspace(0.0, 0.08, 25)
    inner = np.random.default_rng(1).uniform(0.0, 1.0, 21)
    near = 1e-6 * np.concatenate([np.zeros(5), np.sort(inner), np.ones(5)])
    far = (40.0 + near)[:, None]
    pieces = polynomial_pieces(breaks, far, 7, 7)
    exact = evaluate(breaks.tolist(), [far[:, 0].tolist()], 7, breaks[:-1] + 0.5 * breaks[1])[:, 0]
    for order in range(1, 6):
        middle, size = pieces.middle(order, 0), np.abs(exact[order]).max()
        assert (middle.low <= exact[order] + 1e-9 * size).all()
        assert (middle.high >= exact[order] - 1e-9 * size).all()
        assert float((middle.high - middle.low).max()) < 1e-9 * size


def test_a_search_has_a_bound_for_programs_and_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where no proof succeeds: violated places by the ten thousand are thinned."""
    numbers, solved = [], []
    setup = Problem.__init__

    def counted(self: Problem, task: object, samples: np.ndarray, *more: int) -> None:
        numbers.append(len(samples))
        setup(self, task, samples, *more)  # type: ignore[arg-type]

    def refuted(breaks: np.ndarray, *_: object) -> Proof:
        places = np.linspace(0.0, breaks[-1], MAX_PIECES)
        solved.append(len(places))
        return Proof(MAX_PIECES, {}, tuple(Violation("lean", float(t), float(t), 1.0, True) for t in places))

    monkeypatch.setattr(Problem, "__init__", counted)
    monkeypatch.setattr(minimum_time, "prove", refuted)
    monkeypatch.setattr(minimum_time, "MAX_REFINEMENTS", 2)
    plan = planned(START, (0.6395, 0.7024, -0.993))
    assert plan.reference.segments[0].kind == "line"
    assert len(solved) >= 2
    assert max(numbers) <= (1 + 3 * 3) * SPANS * SAMPLES_PER_SPAN


def test_an_undecided_proof_ends_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    tries = []

    def undecided(breaks: np.ndarray, *_: object) -> Proof:
        tries.append(1)
        return Proof(MAX_PIECES, {}, (Violation("lean", 0.0, float(breaks[-1]), 1e-9, False),))

    monkeypatch.setattr(minimum_time, "prove", undecided)
    assert planned(START, (0.6395, 0.7024, -0.993)).reference.segments[0].kind == "line"
    assert len(tries) == 2, "one for each first guess"


def test_a_spent_budget_ends_a_descent(monkeypatch: pytest.MonkeyPatch) -> None:
    budget = ProgramBudget(3)
    assert [budget.spend() for _ in range(5)] == [True, True, True, False, False]
    assert ProgramBudget().programs == MAX_PROGRAMS < 5000
    monkeypatch.setattr(minimum_time, "ProgramBudget", lambda: ProgramBudget(5))
    assert planned(START, NORMAL).reference.segments[0].kind == "line"
    assert programs.MAX_STEPS * MAX_PROGRAMS < 1e6


def test_thinned_places_are_even_and_keep_both_ends() -> None:
    places = np.linspace(0.0, 1.0, 1001)
    thinned = _thin(places, 11)
    np.testing.assert_allclose(thinned, np.linspace(0.0, 1.0, 11), atol=1e-12)
    assert _thin(places[:5], 11) is not None
    assert len(_thin(places[:5], 11)) == 5


def test_a_move_below_a_micrometre_is_refused() -> None:
    with pytest.raises(InputError, match="at least 1e-06 m"):
        planned(START, (0.6295009, 0.7024, -0.993))


def test_the_number_of_segments_to_plan_has_a_bound() -> None:
    segments = tuple(Move(kind="move", to=(1.0, 0.7, -0.7 - 1e-4 * k)) for k in range(MAX_PLANNED + 1))
    empty = scenario(START)
    asked = empty.model_copy(update={"reference": empty.reference.model_copy(update={"segments": segments})})
    with pytest.raises(InputError, match=f"{MAX_PLANNED + 1} segments leave their timing open"):
        plan_segments(asked, None)  # type: ignore[arg-type]


def test_a_proof_of_a_short_motion_along_the_edge_of_its_range_is_decided() -> None:
    plan = planned(
        (1.43, 32.75297444128291, -8.358786291307133), (1.43, 32.75297444128291, -8.3587852), "harbour-crane"
    )
    (segment,) = plan.reference.segments
    assert isinstance(segment, Spline)
    limits = limits_of(plan)._replace(size=1e-2)
    proof = prove(np.array(segment.breaks), np.array(segment.coefficients), 7, limits)
    assert proof.is_valid
    assert proof.pieces < 2000
    assert segment.seconds < 0.05
