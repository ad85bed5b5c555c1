"""What is drawn when: times, casts, trails, dashes, words."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.scenario.drawing import FILED_TRAIL
from cranectl.signals import COLUMN
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from cranectl.support.units import Quantity
from cranectl.tools.render.caption import legend, readings
from cranectl.tools.render.timeline import MAX_DASHES, Timeline, dashes
from tests import conftest
from tests.tools.render.pictures import both_runs, moving_run, sample_at, shift_run


def cut(run: Run, time: float, status: RunStatus = RunStatus.SLACK_ROPE) -> Run:
    """The run as if it had stopped at `time`."""
    last = sample_at(run, time)
    return conftest.cut(run, last + 1, end_ns=int(run.time_ns[last]), status=status)


@pytest.mark.parametrize(
    ("fps", "speed", "count", "step"), [(25.0, 1.0, 351, 0.04), (10.0, 7.0, 21, 0.7), (9.0, 1.0, 127, 1 / 9)]
)
def test_pictures_are_evenly_spaced_and_the_last_is_the_end(
    fps: float, speed: float, count: int, step: float
) -> None:
    times = Timeline.of({"mujoco": moving_run("mujoco")}).times(fps, speed)
    assert len(times) == count
    assert np.allclose(np.diff(times)[:-1], step)
    assert 0.0 < np.diff(times)[-1] <= step * (1 + 1e-9)
    assert (times[0], times[-1]) == (0.0, 14.0)


def test_mujoco_is_solid_and_analytic_is_a_ghost_only_in_a_pair() -> None:
    runs = both_runs()
    timeline = Timeline.of(runs)
    ghosts = {track.run.plant: track.is_ghost for track in timeline.tracks}
    assert ghosts == {"analytic": True, "mujoco": False}
    assert timeline.main.run is runs["mujoco"]
    empty = replace(runs["mujoco"], time_ns=np.zeros(0, np.int64), table=runs["mujoco"].table[:0])
    assert Timeline.of({**runs, "mujoco": empty}).main.run is runs["analytic"]
    with pytest.raises(InputError, match="holds no sample"):
        Timeline.of({"mujoco": empty})


def test_a_still_shows_the_largest_error() -> None:
    run = moving_run("mujoco")
    timeline = Timeline.of({"mujoco": run})
    distance = np.linalg.norm(run.reference[:, :3] - run.load_position, axis=1)
    assert timeline.main.error[timeline.main.row(timeline.worst_time)] == distance.max()
    assert distance.max() > 2.0 * np.median(distance)
    later = replace(run, table=run.table.copy())
    later.table[sample_at(run, 9.0), COLUMN.load] += 1.0
    assert Timeline.of({"mujoco": run, "analytic": later}).worst_time == pytest.approx(9.0, abs=0.01)


def test_the_trail_covers_the_last_seconds() -> None:
    track = Timeline.of({"mujoco": moving_run("mujoco")}).main
    for time, since in ((9.0, 9.0 - FILED_TRAIL), (2.0, 0.0)):
        trail = track.trail(track.row(time))
        assert np.allclose(trail[-1], track.run.load_position[track.row(time)])
        assert np.allclose(trail[0], track.run.load_position[track.row(since)], atol=1e-3)
    assert len(track.trail(0)) == 1


def test_dashes_lie_on_the_path_and_are_never_too_many() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 2000)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    drawn = dashes(circle)
    lengths = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=1)
    assert np.allclose(np.linalg.norm(drawn, axis=2), 1.0, atol=1e-4)
    assert 0.5 < lengths.sum() / (2.0 * np.pi) < 0.6
    long = np.tile(circle, (100, 1))
    assert MAX_DASHES * 0.9 < len(dashes(long)) <= MAX_DASHES + 1
    assert len(dashes(np.ones((5, 3)))) == 0


def test_samples_without_a_finite_position_are_left_out() -> None:
    run = moving_run("mujoco")
    table = run.table.copy()
    table[-3:, COLUMN.load], table[-4, 0] = np.nan, 1e9
    timeline = Timeline.of({"mujoco": replace(run, table=table)})
    assert timeline.duration == run.time[-5]
    assert np.isfinite(timeline.main.error).all()


def test_readings_give_error_distance_and_stop() -> None:
    solid, other = moving_run("mujoco"), shift_run(moving_run("analytic"), 0.25)
    timeline = Timeline.of({"analytic": cut(other, 8.0), "mujoco": solid})
    off = f"{1e6 * timeline.main.error[timeline.main.row(5.0)]:.3g} µm"
    shown = [(f"load off by {off}", "muted"), ("plants apart by 250 mm", "muted")]
    assert readings(timeline, 5.0) == shown
    assert readings(timeline, 9.0)[1:] == [("analytic stopped: slack-rope", "limit")]
    both = Timeline.of({"analytic": cut(other, 8.0), "mujoco": cut(solid, 8.0)})
    assert readings(both, 8.0)[2:] == [("stopped: slack-rope", "limit")]
    assert len(readings(Timeline.of({"mujoco": solid}), 14.0)) == 1


def test_runs_of_an_overlay_are_named_by_their_labels() -> None:
    first, other = moving_run("mujoco"), replace(shift_run(moving_run("mujoco"), 0.25), drive="velocity")
    timeline = Timeline.of({"soft": first, "stiff": other})
    assert [(track.label, track.is_ghost) for track in timeline.tracks] == [("soft", False), ("stiff", True)]
    assert len({track.colour for track in timeline.tracks}) == 2
    off = f"{1e6 * timeline.main.error[timeline.main.row(5.0)]:.3g} µm"
    far = timeline.tracks[1].error[timeline.tracks[1].row(5.0)]
    lines = [text for text, _ in readings(timeline, 5.0)]
    assert lines == [
        f"soft off by {off}",
        f"stiff off by {Quantity(far, 'm')}",
        "others up to 250 mm away",
    ]
    texts = [text for _, text in legend(timeline, np.array([5.0]))]
    assert {"soft: solid", "stiff: ghost"} <= {*texts}
    assert not any("plant" in text for text in texts)


def test_the_legend_names_exactly_what_is_drawn() -> None:
    run = moving_run("mujoco")
    table = run.table.copy()
    table[5, COLUMN.tension] = 0.1
    first = run.time[5]
    calm = cut(run, 4.0)
    hold = replace(run, reference=np.tile(run.reference[:1], (len(run.reference), 1)))
    logs = ({"mujoco": calm}, both_runs(), {"mujoco": replace(run, table=table)}, {"mujoco": hold})
    calm_texts, pair, slack, held = (
        {text for _, text in legend(Timeline.of(runs), np.array([first, 7.0]))} for runs in logs
    )
    assert {"analytic plant: ghost", "disturbance"} <= pair
    assert not any("analytic" in text or text == "disturbance" for text in calm_texts)
    assert ["rope nearly slack" in texts for texts in (calm_texts, pair, slack)] == [False, False, True]
    assert ["its whole path" in texts for texts in (calm_texts, held)] == [True, False]
