"""Overlays contain each run bit for bit under its label, with any plant, drive and logging rate."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.overlay import Layer, Log, check_labels, labels_of, write_overlay
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError, LogError
from tests.conftest import PAIR, closed_loop, cut
from tests.log.corruption import changed, set_metadata
from tests.log.test_log import assert_same
from tests.log.viewer import messages_of

pytestmark = pytest.mark.usefixtures("in_empty_directory")


@pytest.fixture(scope="module")
def layers(short: Scenario) -> dict[str, Layer]:
    """Return runs of different controllers, plants, drives, references and rates; two stopped early."""
    early = simulate_run(short, plant="mujoco", controller="lqr", drive="velocity")
    stopped = {"status": RunStatus.SLACK_ROPE}
    other = load_scenario("settled-trajectory", overrides=["duration=20", "disturbances=[]"])
    return {
        "lqr": Layer(simulate_run(short, plant="mujoco", controller="lqr").every(4), 4, {"numpy": "2"}),
        "pid": Layer(simulate_run(short, plant="analytic", controller="pid").every(10), 10, {"numpy": "1"}),
        "early": Layer(cut(early, 101, end_ns=100_000_000, **stopped).every(1), 1, {"numpy": "3"}),
        "at-once": Layer(cut(early, 0, end_ns=0, **stopped), 1, {"numpy": "3"}),
        "moving_1+": Layer(simulate_run(other, plant="analytic").every(40), 40, {"numpy": "3"}),
    }


def test_every_run_of_an_overlay_is_read_back_bit_for_bit(layers: dict[str, Layer]) -> None:
    path = Path("a.mcap")
    write_overlay(path, layers)
    before, read = path.read_bytes(), Log.read(path).layers
    assert [*read] == [*layers]
    for label, layer in layers.items():
        assert_same(read[label].run, layer.run)
        assert replace(read[label], run=layer.run) == layer
    write_overlay(path, layers)
    assert path.read_bytes() == before


def test_distances_refer_to_the_first_and_to_the_previous_run(layers: dict[str, Layer]) -> None:
    write_overlay(Path("a.mcap"), layers)
    first, second, third = (layers[label].run for label in ("lqr", "pid", "early"))
    for topic, a, b in (
        ("pid/distance", first, second),
        ("early/distance", first, third),
        ("early/step", second, third),
    ):
        messages = messages_of(Path("a.mcap"), f"/{topic}")
        common = np.intersect1d(a.time_ns, b.time_ns)
        assert [time_ns for time_ns, _ in messages] == common.tolist()
        loads = (run.load_position[np.isin(run.time_ns, common)] for run in (a, b))
        assert [message.load_distance for _, message in messages] == pytest.approx(
            np.linalg.norm(np.subtract(*loads), axis=1), abs=1e-14
        )


def test_labels_are_as_short_as_possible() -> None:
    def run(controller: str, drive: str, plant: str) -> Run:
        return closed_loop("fixed-position", controller, plant, drive)

    lqr, other = run("lqr", "ideal", "mujoco"), run("lqr+hinf", "ideal", "mujoco")
    assert labels_of([lqr, other], ["a", "b"]) == ["lqr", "lqr+hinf"]
    assert labels_of([lqr, run("lqr", "velocity", "mujoco")], ["a", "b"]) == ["ideal", "velocity"]
    assert labels_of([lqr, run("lqr", "ideal", "analytic")], ["a", "b"]) == ["lqr-mujoco", "lqr-analytic"]
    assert labels_of([lqr, lqr], ["20 t", "a.b"]) == ["20-t", "a-b"]
    elsewhere = replace(lqr, scenario=lqr.scenario.model_copy(update={"name": "my move"}))
    assert labels_of([lqr, elsewhere], ["a", "b"]) == ["fixed-position", "my-move"]
    assert labels_of([other, elsewhere, lqr], ["a", "b", "c"]) == [
        "fixed-position-lqr+hinf", "my-move-lqr", "fixed-position-lqr"
    ]  # fmt: skip
    by_hand = replace(lqr, design=replace(lqr.design, name="lqr, gains by hand"))
    assert labels_of([by_hand, by_hand], ["a", "a"]) == ["lqr-gains-by-hand-1", "lqr-gains-by-hand-2"]


@pytest.mark.parametrize(
    "labels",
    [["a-b", "a_b"], ["a", "b/c"], ["a", "mujoco"], ["a", "b.c"], ["a" * 41], list("abcdefghijklmn")],
)
def test_invalid_labels_are_refused(labels: list[str]) -> None:
    with pytest.raises(InputError, match=r"the label|an overlay of"):
        check_labels(labels)


def test_an_overlay_combines_runs_of_several_logs(
    short: Scenario, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("lqr", "pole-placement"):
        write_log(f"{name}.mcap", [simulate_run(short, plant=plant, controller=name) for plant in PAIR])
    assert main(["log", "overlay", "lqr.mcap", "pole-placement.mcap", "--out", "both.mcap"]) == 0
    assert "log layout overlay view.json --log both.mcap" in capsys.readouterr().out
    read = Log.read("both.mcap").layers
    for name, layer in read.items():
        assert_same(layer.run, read_log(f"{name}.mcap")["mujoco"])
    assert main(["log", "overlay", "both.mcap", "lqr.mcap", "--plants", "analytic", "--label", "a,b,c"]) == 0
    layers = Log.read("logs/fixed-position/overlay.mcap").layers
    assert [layer.run.plant for layer in layers.values()] == ["mujoco", "mujoco", "analytic"]
    assert main(["log", "overlay", "lqr.mcap", "both.mcap", "--label", "a"]) == 2
    assert "1 labels for 3 runs" in capsys.readouterr().err
    with pytest.raises(LogError, match=r"both\.mcap is an overlay of the runs lqr,pole-placement") as caught:
        read_log("both.mcap")
    assert "report, render" in caught.value.remedy


def test_a_contradictory_overlay_is_refused(layers: dict[str, Layer]) -> None:
    write_overlay(Path("a.mcap"), layers)
    for record, values, problem in (
        ("pid/run/analytic", {"samples": "50"}, "51 of 50 samples of pid/state"),
        ("pid/cranectl", {"plants": "analytic,mujoco"}, "pid has several plants: analytic, mujoco"),
        ("overlay", {"labels": "lqr,nobody"}, "not of cranectl"),
        ("overlay", {"format": "9"}, "that only viewers read"),
    ):
        Path("b.mcap").write_bytes(changed(Path("a.mcap"), set_metadata(record, **values)))
        with pytest.raises(LogError, match=re.escape(problem)):
            Log.read("b.mcap")
    late = replace(layers["lqr"].run, time_ns=layers["lqr"].run.time_ns + 1)
    with pytest.raises(LogError, match=r"cannot write c\.mcap: late would contradict itself"):
        write_overlay(Path("c.mcap"), {"late": Layer(late, 4, {}), "pid": layers["pid"]})
    assert not Path("c.mcap").exists()
