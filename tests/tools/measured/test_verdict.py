"""Runs that were not used are judged: clean ones are covered, and changes of the crane are found."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.writer import write_log
from cranectl.scenario import Scenario
from cranectl.scenario.effects import Body, Rope, Wind
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.tools.measured.comparison import block_means, compare_readings
from cranectl.tools.measured.experiment import Experiment, reading_noise
from cranectl.tools.measured.fit import Fit
from cranectl.tools.measured.identification import Identification, identify
from cranectl.tools.measured.verdict import (
    COVERED,
    NOT_COVERED,
    NOT_DECIDED,
    WITHIN_TOLERANCE,
    RunVerdict,
    judge,
)
from tests.tools.measured.hidden import LAB, NUMBERS, measured_run, with_effects, with_sensing, with_signal

Change = Callable[[Scenario], Scenario]


@pytest.fixture(scope="session")
def fit(result: Identification, runs: list[Run], tmp_path_factory: pytest.TempPathFactory) -> Fit:
    path = tmp_path_factory.mktemp("fit") / "mine.toml"
    path.write_text('extends = "lab-rig"\n')
    Fit.path(path).write_text(Fit.text(result, runs))
    return Fit.read(path)


def verdict_of(
    fit: Fit,
    seed: int = 50,
    *,
    tolerance: float | None = None,
    numbers: Mapping[str, float] | None = None,
    change: Change = lambda scenario: scenario,
    sticks: bool = False,
) -> RunVerdict:
    run = measured_run(LAB, {**NUMBERS, **(numbers or {})}, seed, change=change, sticks=sticks)
    (verdict,) = judge({"a": run}, fit, tolerance=tolerance)
    return verdict


@pytest.mark.parametrize("sticks", [False, True])
@pytest.mark.parametrize("seed", [51, 52])
def test_clean_runs_are_covered(seed: int, sticks: bool, fit: Fit) -> None:
    verdict = verdict_of(fit, seed, tolerance=0.005, sticks=sticks)
    assert verdict.answer == COVERED, verdict
    assert verdict.largest < 0.002
    assert not verdict.swing


DELAY, OFFSET = "effects.delay.seconds", "effects.installation.rope_offset"
CHANGED: dict[str, tuple[Mapping[str, float], Mapping[str, object]]] = {  # numbers and effects
    "load": ({"load_mass": 1.2 * NUMBERS["load_mass"]}, {}),
    "drive": ({"trolley_time_constant": 1.1 * NUMBERS["trolley_time_constant"]}, {}),
    "dead time": ({DELAY: NUMBERS[DELAY] + 0.004}, {}),
    "rope": ({OFFSET: NUMBERS[OFFSET] + 0.02}, {}),
    "load under its hook": ({}, {"body": Body()}),
    "elastic rope": ({}, {"rope": Rope(stiffness=5000.0)}),
    "gusts": ({}, {"wind": Wind(gust=0.5)}),
}


def gusty(scenario: Scenario) -> Scenario:
    changed: Scenario = with_effects(scenario, **CHANGED["gusts"][1])
    return changed


@pytest.mark.parametrize("kind", CHANGED)
def test_a_changed_crane_is_not_covered(kind: str, fit: Fit) -> None:
    numbers, effects = CHANGED[kind]
    verdict = verdict_of(fit, numbers=numbers, change=lambda scenario: with_effects(scenario, **effects))
    assert verdict.answer == NOT_COVERED
    assert verdict.statistic > 8.0
    assert verdict.probability < 0.005


def test_a_tolerance_accepts_differences_or_is_too_narrow_to_decide(fit: Fit) -> None:
    assert verdict_of(fit, tolerance=0.05, change=gusty).answer == WITHIN_TOLERANCE
    assert verdict_of(fit, tolerance=0.0005, change=gusty).answer == NOT_COVERED
    assert verdict_of(fit, tolerance=1e-5).answer == NOT_DECIDED


def test_a_fit_that_did_not_converge_decides_nothing(fit: Fit) -> None:
    assert verdict_of(replace(fit, converged=False)).answer == NOT_DECIDED


def test_probabilities_of_clean_runs_are_neither_all_large_nor_all_small(fit: Fit) -> None:
    """It is neither always large, as with a band that is too wide, nor small."""
    probabilities = np.array([verdict_of(fit, seed, sticks=True).probability for seed in range(100, 112)])
    assert 0.2 < probabilities.mean() < 0.9
    assert probabilities.min() < 0.5 < probabilities.max()


def test_a_run_whose_axes_move_at_first_is_identified_but_not_judged(
    fit: Fit, runs: list[Run], clean: Run
) -> None:
    moving = [part(run, 1.0) for run in runs]
    result = identify(moving, LAB)
    assert result.converged
    values = {estimate.name: estimate.value for estimate in result.estimates}
    assert values["load_mass"] == pytest.approx(NUMBERS["load_mass"], rel=0.01)
    with pytest.raises(InputError, match="a begins in motion: an axis moves within the first") as error:
        judge({"a": part(clean, 1.0)}, fit)
    assert "begins at rest, by from in its map" in error.value.remedy


@pytest.mark.parametrize("rope", [0.35, 0.3775, 0.3885, 1.0])
def test_rest_is_read_from_readings_and_not_from_their_smoothing(rope: float) -> None:
    """A smoothed constant differs by rounding, and a smoothed step has a speed."""
    run = measured_run(LAB, NUMBERS, 50, axes=(1,))
    trolley = run.signal("state.trolley_position")
    first = int(np.argmax(np.abs(trolley - trolley[0]) > 1.5e-4))
    assert first > 50

    def experiment(readings: Array) -> Experiment:
        return Experiment(with_signal(run, "state.rope_length", readings), LAB, "motion", 1000)

    constant = np.full(len(trolley), rope)
    assert experiment(constant).still_samples() == first
    stepped = constant.copy()
    stepped[:2] -= LAB.effects.sensing.position_resolution[2]
    assert experiment(stepped).at_rest
    moved = np.linspace(rope, rope + 0.2, len(trolley))
    assert "an axis moves within the first" in experiment(moved).motion


def test_angles_are_compared_in_metres_at_the_true_length_of_the_rope(fit: Fit, clean: Run) -> None:
    """A rope that is read 0.5 m too long swings no wider for it."""
    values = {**fit.values, OFFSET: 0.5}
    experiment = Experiment(clean, LAB, "commands", 1000)
    shown = compare_readings(experiment, experiment.readings, np.ones(5), values)
    rope = block_means(experiment.readings, experiment.block)[:, 2]
    assert shown.deviation[:, 3] == pytest.approx(rope - 0.5)
    assert (shown.deviation[:, 2] == 1.0).all()


def test_a_run_of_a_few_samples_is_refused(fit: Fit, clean: Run) -> None:
    with pytest.raises(InputError, match="a has 9 samples") as error:
        judge({"a": part(clean, 0.0, 9)}, fit)
    assert error.value.remedy == "record a longer run"


def part(run: Run, begin: float, samples: int | None = None) -> Run:
    """The samples of a run from `begin` [s] on, as an import with `from` gives them."""
    first = int(np.searchsorted(run.time, begin))
    rows = slice(first, None if samples is None else first + samples)
    time_ns = run.time_ns[rows] - run.time_ns[first]
    return replace(
        run, time_ns=time_ns, table=run.table[rows], reference=run.reference[rows], end_ns=int(time_ns[-1])
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_step_of_the_rope_encoder_leaves_the_phase_of_the_swing_open(seed: int, fit: Fit) -> None:
    """A rope that is a millimetre longer than its first reading swings later and later."""
    coarse = with_sensing(position_resolution=(1e-4, 1e-4, 4e-3))
    run = measured_run(coarse, NUMBERS, seed, seconds=20.0)
    (verdict,) = judge({"a": run}, replace(fit, rig=coarse))
    assert verdict.answer == COVERED, verdict
    angles = verdict.comparison.deviation[:, 3:].max(axis=1)
    assert angles.max() > 10.0 * angles[0]


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.25, 1.0])
def test_the_mean_of_readings_keeps_the_rounding_error_that_noise_does_not_shake(noise: float) -> None:
    """`noise` in steps of the encoder; each place between two steps is as likely."""
    rng, step, count = np.random.default_rng(3), 1e-3, 25
    rig = with_sensing(position_resolution=(step,) * 3, position_noise=(noise * step,) * 3)
    places = step * rng.uniform(-0.5, 0.5, 4000)
    readings = np.round(places / step + noise * rng.standard_normal((count, 4000))) * step
    error = float(np.sqrt(np.mean(np.square(readings.mean(axis=0) - places))))
    stated = float(reading_noise(rig, count)[0])
    assert 0.97 * error < stated < 1.25 * error


def test_used_runs_are_refused(fit: Fit, runs: list[Run], clean: Run) -> None:
    # Runs of these tests come from files of one name, so their digests tell them apart by content.
    with pytest.raises(InputError, match="s of b were used to identify the crane"):
        judge({"a": clean, "b": runs[1]}, fit)


def test_the_answers_of_the_command_line(
    result: Identification, runs: list[Run], clean: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text('extends = "lab-rig"\n')
    Path("mine-fit.json").write_text(Fit.text(result, runs))
    write_log("new.mcap", [clean])
    write_log("gusts.mcap", [measured_run(LAB, NUMBERS, 50, change=gusty)])
    judged = ["validate", "new.mcap", "--rig", "mine.toml"]
    assert main([*judged, "--tolerance", "5mm", "--json", "v.json"]) == 0
    assert "All runs are covered" in capsys.readouterr().out
    assert json.loads(Path("v.json").read_text())["verdicts"][0]["answer"] == COVERED
    both = ["validate", "new.mcap", "gusts.mcap", "--rig", "mine.toml"]
    assert main([*both, "--junit", "j.xml", "--report", "v.html"]) == 1
    assert "1 of 2 runs are covered" in capsys.readouterr().out
    passed, failed = ElementTree.parse("j.xml").getroot().iter("testcase")
    assert passed.get("name") == "new.mcap"
    assert passed.find("failure") is None
    (failure,) = failed
    assert "standard deviations; the first difference beyond the model is at" in failure.get("message", "")
    assert f"again: cranectl {' '.join(both)}" in str(failure.text)
    page = Path("v.html").read_text(encoding="utf-8")
    assert "covered: new.mcap" in page
    assert "not covered: gusts.mcap" in page
    assert page.count("<svg") == 2
    figures = [text for text in re.findall(r"<text[^>]*>([^<]*)</text>", page) if "load" in text]
    assert figures == 2 * ["α, at the load [m]", "β, at the load [m]"]
    assert main(["validate", "gusts.mcap", "--rig", "mine.toml", "--tolerance", "5cm"]) == 0
    Path("copy.mcap").write_bytes(Path("new.mcap").read_bytes())
    again = ["validate", "new.mcap", "new.mcap", "./new.mcap", "copy.mcap", "--rig", "mine.toml"]
    capsys.readouterr()
    assert main([*again, "--json", "r.json", "--junit", "r.xml"]) == 0
    said = capsys.readouterr().out
    assert "new.mcap is given twice, and judged once" in said
    assert "copy.mcap has the readings of new.mcap, and is judged with it" in said
    facts = json.loads(Path("r.json").read_text())
    assert facts["verdicts"] == json.loads(Path("v.json").read_text())["verdicts"]
    assert facts["repeated"] == [
        {"name": n, "same_as": "new.mcap"} for n in ("new.mcap", "new.mcap", "copy.mcap")
    ]
    assert len(list(ElementTree.parse("r.xml").getroot().iter("testcase"))) == 1
    refused = {
        (*judged, "--tolerance", "5"): "write --tolerance 5mm",
        (*judged, "--jobs", "2"): "leave out --jobs",
        ("validate", "new.mcap"): "cranectl validate LOG --rig identified.toml --tolerance 5mm",
        (
            "validate",
            "fixed-position",
            "new.mcap",
            "--rig",
            "mine.toml",
        ): "judge scenarios and measured runs by two commands",
        ("validate", "new.mcap", "--rig", "lab-rig"): "identify the crane again, with --out lab-rig",
    }
    for arguments, remedy in refused.items():
        assert main(list(arguments)) == 2
        assert remedy in capsys.readouterr().err
