"""The numbers of a hidden crane in MuJoCo are found from its readings, and what cannot be found is named."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.writer import write_log
from cranectl.scenario.load import RigFile
from cranectl.simulate import Run
from cranectl.support.errors import InputError
from cranectl.tools.measured.experiment import Experiment
from cranectl.tools.measured.identification import Identification, identify
from cranectl.tools.measured.identified import campaign_text, rig_text
from cranectl.tools.measured.least_squares import LeastSquares
from cranectl.tools.measured.replay import positions_before
from cranectl.tools.measured.report import IdentificationReport
from cranectl.tools.measured.unknowns import unknowns_of
from tests.tools.measured.hidden import LAB, NUMBERS, measured_run, with_sensing, with_signal
from tests.tools.measured.simulator import Defects, hidden_run


def test_all_numbers_are_found_within_their_intervals(result: Identification) -> None:
    assert result.converged
    assert not result.unidentifiable
    assert 0.9 < result.misfit < 1.1
    assert IdentificationReport.remarks(result) == []
    errors = {e.name: e.value - NUMBERS[e.name] for e in result.estimates}
    assert errors.keys() == NUMBERS.keys()
    inside = [abs(errors[e.name]) < e.half_width for e in result.estimates]
    assert sum(inside) >= len(inside) - 1
    for name, error in errors.items():
        if "pivot" not in name and "offset" not in name and "delay" not in name:
            assert abs(error) < 0.01 * NUMBERS[name], name
    assert abs(errors["effects.delay.seconds"]) < 60e-6
    assert abs(errors["effects.installation.rope_offset"]) < 1e-4


def test_intervals_have_what_coarse_encoders_leave_open() -> None:
    """A reading that stays in one step repeats its error, also if four runs happen to agree."""
    coarse = with_sensing(position_resolution=(2e-3, 2e-3, 2e-3))
    result = identify([measured_run(coarse, NUMBERS, seed) for seed in range(3)], coarse)
    outside = [e.name for e in result.estimates if abs(e.value - NUMBERS[e.name]) > e.half_width]
    assert len(outside) <= 1, outside
    rope = next(e for e in result.estimates if e.name.endswith("rope_offset"))
    assert rope.half_width > 1.9 * rope.encoders > 1e-5


def test_the_motion_of_the_axes_tells_rope_and_pivot(runs: list[Run]) -> None:
    """It is taken by default if the runs have no commands."""
    (group,) = (group for group in runs[0].groups if group.name == "command")
    without = [
        replace(run, table=run.table[:, : -len(group)], own_groups=tuple(g for g in run.groups if g != group))
        for run in runs
    ]
    with pytest.raises(InputError, match="no commands of the drives") as error:
        identify(without, LAB, replay="commands")
    assert error.value.remedy == "add --replay motion"
    result = identify(without, LAB)
    assert result.replay == "motion"
    values = {estimate.name: estimate.value for estimate in result.estimates}
    assert len(values) == 5
    assert values["angles.scale"] == pytest.approx(1.0, abs=1e-3)
    assert values["angles.delay"] == pytest.approx(0.0, abs=1e-3)
    name = "effects.installation.rope_offset"
    assert values[name] == pytest.approx(NUMBERS[name], abs=2e-4)
    # Only friction over mass is seen, and the mass is that of the rig.
    assert values["effects.friction.pivot_viscous"] == pytest.approx(
        NUMBERS["effects.friction.pivot_viscous"] * LAB.load_mass / NUMBERS["load_mass"], rel=0.15
    )


def test_scale_and_delay_of_a_camera_are_found(runs: list[Run]) -> None:
    """Angles of a camera that sees 9/10 of the angle, 60 ms late."""
    seen = []
    for run in runs:
        late = round(0.06 / run.scenario.period_ns * 1e9)
        for name in ("state.alpha", "state.beta"):
            angle = run.signal(name)
            run = with_signal(run, name, 0.9 * np.concatenate([angle[:late], angle[:-late]]))
        seen.append(run)
    result = identify(seen, LAB, replay="motion")
    values = {estimate.name: estimate.value for estimate in result.estimates}
    assert values["angles.scale"] == pytest.approx(0.9, abs=2e-3)
    assert values["angles.delay"] == pytest.approx(0.06, abs=1e-3)
    said = " ".join(IdentificationReport.remarks(result))
    assert "multiply the scale of alpha and beta in the map by 1.11" in said
    assert re.search(r"add 0\.0[56]\d* to the delay of alpha and beta in the map", said)
    rope = 1e3 * NUMBERS["effects.installation.rope_offset"]
    assert f"the rope is read {abs(rope):.2g}" in said
    assert "to the zero of rope_length in the map" in said
    assert "angles" not in rig_text(result, "lab-rig", "three runs")
    assert "angles" not in campaign_text(result, "mine.toml", "mine", "three runs")


def test_residuals_that_last_are_told_though_noise_would_explain_their_size(runs: list[Run]) -> None:
    """Angles that drift, as of a camera, with a noise that is stated as large as the drift."""
    drifting = []
    for seed, run in enumerate(runs):
        drift = 4e-3 * np.sin(2.5 * run.time + seed)
        drifting.append(with_signal(run, "state.alpha", run.signal("state.alpha") + drift))
    result = identify(drifting, with_sensing(angle_noise=4e-3), replay="motion")
    assert result.converged
    (said,) = (
        remark for remark in IdentificationReport.remarks(result) if remark.startswith("residuals last")
    )
    assert "intervals are too narrow" in said


def test_runs_along_one_axis_say_nothing_of_the_others() -> None:
    runs = [measured_run(LAB, NUMBERS, seed, seconds=6.0, axes=(1,)) for seed in range(3)]
    result = identify(runs, LAB)
    named = set(result.unidentifiable)
    assert {
        "bridge_time_constant",
        "effects.friction.coulomb.0",
        "effects.installation.drive_gain.2",
    } <= named
    assert not named & {estimate.name for estimate in result.estimates}
    assert result.rig.bridge_time_constant == LAB.bridge_time_constant
    gain = next(e for e in result.estimates if e.name == "effects.installation.drive_gain.1")
    assert gain.value == pytest.approx(NUMBERS[gain.name], rel=1e-3)


def test_a_misfit_is_told_in_millimetres_and_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for seed in range(3):
        run, _ = hidden_run(LAB, NUMBERS, seed, seconds=6.0, defects=Defects(frame_hertz=3.0))
        write_log(tmp_path / f"{seed}.mcap", [run])
    assert main(["identify", "0.mcap", "1.mcap", "2.mcap", "--rig", "lab-rig", "--json", "r.json"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    told = re.search(r"MISFIT: up to ([\d.]+) mm at the load, in ([012]).mcap at ([\d.]+) s", said)
    assert told
    facts = json.loads(Path("r.json").read_text())
    assert facts["converged"]
    assert float(told[1]) == pytest.approx(1e3 * max(facts["largest_m"]), rel=0.01)
    assert facts["largest_m"][int(told[2])] == max(facts["largest_m"])
    worst = max(facts["misfits"], key=facts["misfits"].get)
    assert f"residuals of {worst} are" in said


def test_each_channel_has_its_own_misfit_and_overstated_noise_is_told(runs: list[Run]) -> None:
    """One channel of five with three times its noise passes a test of their mean."""
    noisy, rng = [], np.random.default_rng(0)
    for run in runs:
        more = np.sqrt(8.0) * np.hypot(LAB.effects.sensing.angle_noise, 3.8e-4 / np.sqrt(12.0))
        noisy.append(
            with_signal(
                run, "state.alpha", run.signal("state.alpha") + more * rng.standard_normal(len(run.time_ns))
            )
        )
    misfits = identify(noisy, LAB).misfits
    assert misfits["alpha"] == pytest.approx(9.0, rel=0.2)
    assert max(value for name, value in misfits.items() if name != "alpha") < 1.2
    overstated = identify(runs, with_sensing(angle_noise=4e-3))
    (alpha, beta) = (said for said in IdentificationReport.remarks(overstated) if "is overstated" in said)
    assert "the noise of alpha is overstated" in alpha
    assert "the noise of beta is overstated" in beta


def test_two_runs_are_not_enough(runs: list[Run]) -> None:
    with pytest.raises(InputError, match="2 measured runs") as error:
        identify(runs[:2], LAB)
    assert "cut a long log where the crane rests" in error.value.remedy


@pytest.mark.parametrize("late", [0.0, 0.003, 0.01])
def test_positions_between_two_samples_are_those_of_a_smooth_motion(late: float) -> None:
    """A swing that is sampled 63 times: its cubics err by a 384th of the fourth derivative, 3e-7."""
    period, time = 0.01, 0.01 * np.arange(200)
    phases = 10.0 * time[:, None] + np.arange(5.0)
    state = np.empty((200, 10))
    state[:, 0::2], state[:, 1::2] = np.sin(phases), 10.0 * np.cos(phases)
    before = positions_before(state, late, period)
    assert np.abs(before - np.sin(phases - 10.0 * late))[1:].max() < 3e-7
    assert np.abs(before[0] - (state[0, 0::2] - late * state[0, 1::2])).max() < 1e-15


def test_an_identified_crane_is_a_rig_and_a_campaign(
    runs: list[Run], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for k, run in enumerate(runs):
        write_log(tmp_path / f"{k}.mcap", [run])
    logs = ["0.mcap", "1.mcap", "2.mcap"]
    identified = ["identify", *logs, "--rig", "lab-rig", "--out", "mine.toml"]
    assert main([*identified, "--json", "r.json", "--report", "r.html"]) == 0
    page = Path("r.html").read_text(encoding="utf-8")
    assert "The residuals are as large as the stated noise of the readings." in page
    assert page.count("<svg") == 1 + len(logs)  # intervals, and a figure for each run
    assert "Identified from the commands of 3 runs" in capsys.readouterr().out
    rig = RigFile.load("mine.toml")
    assert rig.load_mass == pytest.approx(NUMBERS["load_mass"], rel=0.01)
    assert rig.effects.friction.viscous == (0.0, 0.0, 0.0)
    assert rig.bridge_mass == LAB.bridge_mass
    estimates = json.loads(Path("r.json").read_text())["estimates"]
    assert len(estimates) == 14
    campaign = tomllib.loads(Path("mine-campaign.toml").read_text())
    assert campaign["rig"] == "mine.toml"
    assert main(["campaign", "run", "mine-campaign.toml", "--runs", "4", "--out", "result"]) == 0
    (tmp_path / "other.toml").write_text("my notes")
    assert main(["identify", *logs, "--rig", "lab-rig", "--out", "other.toml"]) == 2


def test_a_simulated_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "fixed-position", "--set", "duration=0.5", "--set", "disturbances=[]", "--plants",
                 "analytic", "--controller", "lqr", "--out", str(tmp_path / "a.mcap")]) == 0  # fmt: skip
    assert main(["identify", *[str(tmp_path / "a.mcap")] * 3, "--rig", "lab-rig"]) == 2
    assert "has no measured run with angles" in capsys.readouterr().err


def test_a_number_that_is_left_out_has_the_value_of_the_rig_again(runs: list[Run]) -> None:
    """Slopes and residuals at the fitted value stayed, and the others made up for it a thousand times."""
    experiments = [Experiment(run, LAB, "commands", 1000) for run in runs[:3]]
    fit = LeastSquares(experiments, unknowns_of(LAB, "commands"))
    fit.drop_without_effect()
    fit.solve(3.0)
    kept = [unknown.name for unknown in fit.unknowns]
    fit.deviations[kept.index("load_mass")] = 1.0
    assert fit.drop_unidentifiable()
    assert "load_mass" not in [unknown.name for unknown in fit.unknowns]
    for (experiment, (base, _, _)), own in zip(fit.runs(), fit.own, strict=True):
        again = experiment.residuals(fit.values(fit.common), own * experiment.own_scale)
        assert np.array_equal(base, again)
    fit.deviations = np.ones(len(fit.unknowns))
    assert fit.drop_unidentifiable()
    assert not fit.unknowns, "nothing is left to be fitted, which identify then says"
    assert [by_common.shape for _, by_common, _ in fit.parts] == [(len(base), 0) for base, _, _ in fit.parts]
