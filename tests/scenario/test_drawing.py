"""The size in which a rig is drawn: the laboratory as in the model file, others equally well visible."""

import numpy as np
import pytest

from cranectl.plants.mujoco.geometry import rig_solids
from cranectl.scenario.drawing import CraneKind, Drawing
from cranectl.scenario.rig import Look, RigParameters

LABORATORY = RigParameters()
HARBOUR = RigParameters(
    bridge_range=(0.0, 40.0), trolley_range=(0.0, 20.0), rope_range=(2.0, 45.0), load_mass=2e4
)
TRACK = RigParameters(bridge_range=(-50.0, 150.0), trolley_range=(3.0, 8.0), rope_range=(1.0, 10.0))
SHAFT = RigParameters(bridge_range=(0.0, 5.0), trolley_range=(0.0, 4.0), rope_range=(1.0, 300.0))
TABLE = RigParameters(
    bridge_range=(0.0, 0.3), trolley_range=(0.0, 0.2), rope_range=(0.02, 0.3), load_mass=0.01
)
RIGS = {"laboratory": LABORATORY, "harbour": HARBOUR, "track": TRACK, "shaft": SHAFT, "table": TABLE}
RANGES = ("bridge_range", "trolley_range", "rope_range")

LEAN = np.array([[0.76, 0.65, 0.0], [-0.215, 0.251, 0.944], [0.6136, -0.7174, 0.3305]])
SIDE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
TANGENTS = np.array([0.48, 0.36])


def similar(times: float) -> RigParameters:
    """Return the laboratory's rig, `times` as large."""
    ranges = {name: tuple(times * np.array(getattr(LABORATORY, name))) for name in RANGES}
    return RigParameters(**ranges, load_mass=times**3 * LABORATORY.load_mass)


@pytest.mark.parametrize("times", [1.0, 0.1, 2.5])
def test_a_rig_of_the_laboratorys_shape_is_drawn_to_scale(times: float) -> None:
    rig = similar(times)
    filed = np.array([2.1, -0.12, -1.37])
    assert Drawing(rig).scale == pytest.approx(times) == Drawing(rig).reach
    assert Drawing(rig).load_radius == pytest.approx(0.05 * times)
    assert Drawing(rig).place(filed) == pytest.approx(times * filed)
    eye, farther = Drawing(rig).eye(np.array([3.9, -2.6, 0.75]), LEAN, TANGENTS)
    assert eye == pytest.approx(times * np.array([3.9, -2.6, 0.75]))
    assert farther == pytest.approx(times)
    assert Drawing(rig).trail == pytest.approx(4.0 * np.sqrt(times)), "as a pendulum swings"


def test_one_long_side_alone_makes_no_thick_parts() -> None:
    for rig in (TRACK, SHAFT):
        thickness = Drawing(rig).scale * 0.17  # of the trolley, the widest part
        assert thickness < 0.3 * np.ptp(Drawing(rig).box, axis=0).min()
        assert Drawing(rig).scale < 0.2 * Drawing(rig).reach


def test_parts_stand_as_far_from_the_ends_of_the_ranges_as_filed() -> None:
    for filed, expected in (
        ([-0.1, 1.66, -1.4], [-0.1 * 20.0, 20.0 + 0.12 * 20.0, -45.0]),
        ([2.1, -0.12, 0.095], [40.0 + 0.1 * 20.0, -0.12 * 20.0, 0.095 * 20.0]),
    ):
        assert Drawing(HARBOUR).place(np.array(filed)) == pytest.approx(expected)


def test_a_load_of_any_mass_is_visible_and_hides_nothing() -> None:
    assert Drawing(HARBOUR).load_radius == pytest.approx(0.05 * 20000.0 ** (1.0 / 3.0))
    radii = [Drawing(HARBOUR.model_copy(update={"load_mass": mass})).load_radius for mass in (1e-3, 2e4, 1e6)]
    assert radii == sorted(radii)
    assert 0.5 < radii[0] < radii[-1] <= 2.0


@pytest.mark.parametrize("axes", [LEAN, SIDE], ids=["overview", "side"])
@pytest.mark.parametrize("name", RIGS)
def test_every_rig_is_whole_in_a_picture_and_fills_it(name: str, axes: np.ndarray) -> None:
    """The picture is as full as the laboratory's, to a fifth, since rigs differ in shape."""

    def fullness(rig: RigParameters, eye: np.ndarray) -> float:
        corners = np.array(np.meshgrid(*Drawing(rig).box.T)).reshape(3, -1)
        right_up, back = np.split(axes @ (corners - eye[:, None]), [2])
        assert (back < 0.0).all(), "before the camera"
        return float((np.abs(right_up / back) / TANGENTS[:, None]).max())

    rig, filed = RIGS[name], Drawing(LABORATORY).box.mean(axis=0) + 5.0 * axes[2]
    eye, _ = Drawing(rig).eye(filed, axes, TANGENTS)
    assert fullness(rig, eye) == pytest.approx(fullness(LABORATORY, filed), rel=0.2)
    assert fullness(rig, eye) < 0.95


def crane(bridge: float, trolley: float, lift: float) -> RigParameters:
    """A rig with these travels and this lift [m]."""
    ranges = {"bridge_range": (0.0, bridge), "trolley_range": (0.0, trolley), "rope_range": (1.0, 1.0 + lift)}
    return RigParameters(**ranges, load_mass=2e4)


@pytest.mark.parametrize(
    ("rig", "kind"),
    [
        (LABORATORY, "laboratory frame"),
        (TABLE, "laboratory frame"),
        (similar(3.0), "laboratory frame"),
        (SHAFT, "laboratory frame"),
        (similar(3.1), "bridge crane"),
        (TRACK, "bridge crane"),
        (crane(30.0, 18.0, 9.0), "bridge crane"),
        (crane(90.0, 40.0, 19.0), "bridge crane"),
        (crane(90.0, 40.0, 20.0), "ship-to-shore crane"),
        (crane(30.0, 25.0, 14.9), "bridge crane"),
        (HARBOUR, "ship-to-shore crane"),
        (similar(20.0), "ship-to-shore crane"),
    ],
)
def test_size_and_proportions_decide_what_is_drawn(rig: RigParameters, kind: CraneKind) -> None:
    assert Drawing(rig).kind == kind
    names = {solid.name for solid in rig_solids(rig)}
    assert ("bridge_motor" in names) == (kind == "laboratory frame")
    assert ("crab" in names) == (kind == "bridge crane")
    assert ("load_container" in names) == (kind == "ship-to-shore crane")
    assert {solid.body for solid in rig_solids(rig)} == {"frame", "bridge", "trolley", "load"}


@pytest.mark.parametrize("rig", [HARBOUR, TRACK, similar(20.0)], ids=["harbour", "track", "large"])
def test_every_part_is_within_the_box_that_cameras_show(rig: RigParameters) -> None:
    (low, high), travel = Drawing(rig).box, np.array([rig.bridge_range, rig.trolley_range])
    least = 1e-3 * Drawing(rig).scale  # feet and water stand in the floor
    for solid in rig_solids(rig):
        if solid.body == "load" or solid.name == "water":
            continue
        is_box = solid.kind == "box"  # of a bar, its middle is enough
        moved = np.zeros((2, 3))
        moved[:, 0] = travel[0] if solid.body in ("bridge", "trolley") else 0.0
        moved[:, 1] = travel[1] if solid.body == "trolley" else 0.0
        centre, half = np.array(solid.position) + moved, 0.5 * is_box * np.array(solid.size)
        assert (centre - half > low - least).all(), solid.name
        assert (centre + half < high + least).all(), solid.name


@pytest.mark.parametrize("rig", [HARBOUR, crane(30.0, 45.0, 37.0)], ids=["narrow", "harbour-crane"])
def test_a_container_passes_between_the_legs_of_its_portal(rig: RigParameters) -> None:
    solids, portal = {solid.name: solid for solid in rig_solids(rig)}, Drawing(rig).portal
    legs = [solid for name, solid in solids.items() if "post" in name]
    assert len(legs) == 4
    inside = min(abs(leg.position[0]) - leg.size[0] / 2.0 for leg in legs)
    assert solids["load_container"].size[0] / 2.0 < 0.7 * inside
    assert portal.landside < rig.trolley_range[0] < portal.waterside < rig.trolley_range[1] < portal.girder[1]
    assert min(solids[f"girder_{k}"].position[2] for k in (0, 1)) > 0.0, "above the rope's upper end"


def test_a_rig_has_settings_of_its_drawing() -> None:
    """`look` can leave out posts, so that none hides the load, and set the radius of the ball."""
    for rig in (LABORATORY, HARBOUR, TRACK):
        look = rig.model_copy(update={"look": Look(frame=False, load_radius=0.3)})
        whole, shown = ({solid.name: solid for solid in rig_solids(drawn_rig)} for drawn_rig in (rig, look))
        assert {name for name in whole if name not in shown and not name.startswith("load")} == {
            name for name in whole if name.startswith(("post", "near_post", "top_beam", "foot_beam"))
        }
        assert {"rail_0", "rail_1"} <= set(shown)
        assert shown["load_ball"].size == pytest.approx((0.6, 0.6, 0.6))
