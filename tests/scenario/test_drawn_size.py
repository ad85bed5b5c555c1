"""The size that a rig is drawn in: the laboratory's as filed, others as well seen."""

import numpy as np
import pytest

from cranectl.plants.mujoco.geometry import rig_solids
from cranectl.scenario.drawn_size import (
    LABORATORY,
    drawn_box,
    drawn_eye,
    drawn_load_radius,
    drawn_place,
    drawn_reach,
    drawn_scale,
    drawn_trail,
)
from cranectl.scenario.rig import Look, RigParameters

HARBOUR = RigParameters(
    bridge_range=(0.0, 40.0), trolley_range=(0.0, 20.0), rope_range=(2.0, 45.0), load_mass=2e4
)
TRACK = RigParameters(bridge_range=(-50.0, 150.0), trolley_range=(3.0, 8.0), rope_range=(1.0, 10.0))
SHAFT = RigParameters(bridge_range=(0.0, 5.0), trolley_range=(0.0, 4.0), rope_range=(1.0, 300.0))
TABLE = RigParameters(
    bridge_range=(0.0, 0.3), trolley_range=(0.0, 0.2), rope_range=(0.02, 0.3), load_mass=0.01
)
RIGS = [LABORATORY, HARBOUR, TRACK, SHAFT, TABLE]

LEAN = np.array([[0.76, 0.65, 0.0], [-0.215, 0.251, 0.944], [0.6136, -0.7174, 0.3305]])
SIDE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
TANGENTS = np.array([0.48, 0.36])


def similar(times: float) -> RigParameters:
    """The laboratory's rig, so many times as large."""
    ranges = {name: tuple(times * np.array(getattr(LABORATORY, name))) for name in RANGES}
    return RigParameters(**ranges, load_mass=times**3 * LABORATORY.load_mass)


RANGES = ("bridge_range", "trolley_range", "rope_range")


@pytest.mark.parametrize("times", [1.0, 0.1, 20.0])
def test_a_rig_of_the_laboratorys_shape_is_drawn_to_scale(times: float) -> None:
    rig = similar(times)
    filed = np.array([2.1, -0.12, -1.37])
    assert drawn_scale(rig) == pytest.approx(times) == drawn_reach(rig)
    assert drawn_load_radius(rig) == pytest.approx(0.05 * times)
    assert drawn_place(filed, rig) == pytest.approx(times * filed)
    eye, farther = drawn_eye(np.array([3.9, -2.6, 0.75]), LEAN, TANGENTS, rig)
    assert eye == pytest.approx(times * np.array([3.9, -2.6, 0.75]))
    assert farther == pytest.approx(times)
    assert drawn_trail(rig) == pytest.approx(4.0 * np.sqrt(times)), "as a pendulum swings"


@pytest.mark.parametrize("rig", [TRACK, SHAFT], ids=["track", "shaft"])
def test_one_long_side_alone_makes_no_thick_parts(rig: RigParameters) -> None:
    thickness = drawn_scale(rig) * 0.17  # of the trolley, the widest part
    assert thickness < 0.3 * np.ptp(drawn_box(rig), axis=0).min()
    assert drawn_scale(rig) < 0.2 * drawn_reach(rig)


def test_parts_stand_as_far_from_the_ends_of_the_ranges_as_filed() -> None:
    for filed, expected in (
        ([-0.1, 1.66, -1.4], [-0.1 * 20.0, 20.0 + 0.12 * 20.0, -45.0]),
        ([2.1, -0.12, 0.095], [40.0 + 0.1 * 20.0, -0.12 * 20.0, 0.095 * 20.0]),
    ):
        assert drawn_place(np.array(filed), HARBOUR) == pytest.approx(expected)


def test_a_load_is_seen_and_hides_nothing_whatever_its_mass() -> None:
    assert drawn_load_radius(HARBOUR) == pytest.approx(0.05 * 20000.0 ** (1.0 / 3.0))
    radii = [drawn_load_radius(HARBOUR.model_copy(update={"load_mass": mass})) for mass in (1e-3, 2e4, 1e6)]
    assert radii == sorted(radii)
    assert 0.5 < radii[0] < radii[-1] <= 2.0


@pytest.mark.parametrize("axes", [LEAN, SIDE], ids=["overview", "side"])
@pytest.mark.parametrize("rig", RIGS, ids=["laboratory", "harbour", "track", "shaft", "table"])
def test_every_rig_is_whole_in_a_picture_and_fills_it(rig: RigParameters, axes: np.ndarray) -> None:
    """As full as it was of the laboratory's, to a fifth: rigs differ in shape."""

    def fullness(rig: RigParameters, eye: np.ndarray) -> float:
        corners = np.array(np.meshgrid(*drawn_box(rig).T)).reshape(3, -1)
        right_up, back = np.split(axes @ (corners - eye[:, None]), [2])
        assert (back < 0.0).all(), "before the camera"
        return float((np.abs(right_up / back) / TANGENTS[:, None]).max())

    filed = drawn_box(LABORATORY).mean(axis=0) + 5.0 * axes[2]
    eye, _ = drawn_eye(filed, axes, TANGENTS, rig)
    assert fullness(rig, eye) == pytest.approx(fullness(LABORATORY, filed), rel=0.2)
    assert fullness(rig, eye) < 0.95


def test_a_rig_says_how_it_is_drawn() -> None:
    """Rails alone, so that no post hides the load; a ball of its own size."""
    for rig in (LABORATORY, HARBOUR):
        look = rig.model_copy(update={"look": Look(frame=False, load_radius=0.3)})
        whole, shown = ({solid.name: solid for solid in rig_solids(each)} for each in (rig, look))
        assert {name for name in whole if name not in shown} == {
            name for name in whole if name.startswith(("post", "top_beam", "foot_beam"))
        }
        assert {"rail_0", "rail_1"} <= set(shown)
        assert shown["load_ball"].size == pytest.approx((0.6, 0.6, 0.6))
