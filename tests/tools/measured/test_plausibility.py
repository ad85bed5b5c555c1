"""What physics says of right logs, of logs of no use, and of readings that are missing."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.scenario.load import RigFile
from cranectl.simulate import simulate_run
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.tools.measured.mapping import MeasuredMap
from cranectl.tools.measured.plausibility import check_physics
from cranectl.tools.measured.responses import Recording
from tests.tools.measured.crane import COMMANDS, SIGNALS, columns, imported, mapping, write_csv
from tests.tools.measured.pendulum import moves, record
from tests.tools.measured.test_mistakes import COLUMNS, recorded

Table = dict[str, Array]
VELOCITY = mapping(COMMANDS, commands="velocity")


def noisy(table: Table, rng: np.random.Generator, lengths: float, angles: float) -> Table:
    sizes = dict.fromkeys(("x", "y", "l"), lengths) | dict.fromkeys(("alpha", "beta"), angles)
    return {n: v + sizes.get(n, 0.0) * rng.standard_normal(len(v)) for n, v in table.items()}


def coarse(table: Table, lengths: float, angles: float) -> Table:
    steps = dict.fromkeys(("x", "y", "l"), lengths) | dict.fromkeys(("alpha", "beta"), angles)
    return {n: np.round(v / steps[n]) * steps[n] if n in steps else v for n, v in table.items()}


RIGHT_LOGS: dict[str, Callable[[str, int], Table]] = {
    "exact": lambda rig, seed: record(RigFile.load(rig), moves(RigFile.load(rig), seed)),
    "strongly damped": lambda rig, seed: record(
        RigFile.load(rig), moves(RigFile.load(rig), seed), damping=0.02
    ),
    "along x": lambda rig, seed: record(RigFile.load(rig), moves(RigFile.load(rig), seed, axes=(0,))),
    "along y with a free swing along x": lambda rig, seed: record(
        RigFile.load(rig), moves(RigFile.load(rig), seed, axes=(1,)), swing=(0.05, 0.0)
    ),
    "hoisting only": lambda rig, seed: record(RigFile.load(rig), moves(RigFile.load(rig), seed, axes=(2,))),
    "free swing": lambda rig, seed: record(
        RigFile.load(rig), moves(RigFile.load(rig), seed, axes=()), swing=(0.1, 0.07)
    ),
    "few samples a swing": lambda rig, seed: record(
        RigFile.load(rig), moves(RigFile.load(rig), seed, rows=16), fine=24
    ),
    "slow drives": lambda rig, seed: record(
        RigFile.load(rig), moves(RigFile.load(rig), seed), lags=5.0 * RigFile.load(rig).time_constants
    ),
    "noise": lambda rig, seed: noisy(
        record(RigFile.load(rig), moves(RigFile.load(rig), seed)), np.random.default_rng(seed), 2e-3, 3e-3
    ),
    "coarse encoders": lambda rig, seed: coarse(
        record(RigFile.load(rig), moves(RigFile.load(rig), seed)), 0.011, 5e-3
    ),
    "pauses of the writer": lambda rig, seed: record(
        RigFile.load(rig), moves(RigFile.load(rig), seed, swings=3.0)
    ),
}


@pytest.mark.parametrize("rig", ["lab-rig", "bridge-crane", "harbour-crane"])
@pytest.mark.parametrize("case", RIGHT_LOGS)
def test_right_logs_are_not_refused(case: str, rig: str) -> None:
    for seed in (11, 12, 13):
        table = RIGHT_LOGS[case](rig, seed)
        for settings in (VELOCITY, mapping()):  # with commands and without
            log = recorded(table, settings)
            assert check_physics([log], settings, RigFile.load(rig)).contradictions == (), (
                seed,
                settings.commands,
            )


@pytest.mark.parametrize("plant", ["elastic", "mujoco"])
@pytest.mark.parametrize("name", ["fast-diagonal", "workshop-move", "ship-to-shore"])
@pytest.mark.parametrize("effects", [("friction",), ("friction", "sensing"), ("friction", "body", "frame")])
def test_right_logs_of_plants_with_effects_are_not_refused(
    effects: tuple[str, ...], name: str, plant: str
) -> None:
    scenario = load_scenario(name)
    chosen = {effect: getattr(scenario.rig.effects, effect) for effect in effects}
    scenario = scenario.model_copy(update={"effects": scenario.effects.model_copy(update=chosen)})
    run = simulate_run(scenario, plant=plant, controller="lqr", drive="velocity")
    table = dict(zip(COLUMNS.values(), [*run.block("state").T[::2], *run.block("input").T[3:6]], strict=True))
    table = {"t": run.time, **table}
    table = {column: values[::5] for column, values in table.items()}
    verdict = check_physics([recorded(table, VELOCITY)], VELOCITY, scenario.rig)
    assert verdict.contradictions == ()


def test_correlations_lie_between_minus_one_and_one() -> None:
    """Of signals that have nothing to do with each other, and of tiny and huge ones."""
    rng = np.random.default_rng(4)
    for size in (1e-150, 1.0, 1e100):
        table = {name: size * rng.standard_normal(300).cumsum() for name in COLUMNS.values()}
        table |= {"t": 0.02 * np.arange(300), "l": 1.0 + 0.1 * rng.random(300)}
        for finding in check_physics([recorded(table, VELOCITY)], VELOCITY, RigFile.load("lab-rig")).findings:
            assert np.isnan(finding.correlation) or -1.0 <= finding.correlation <= 1.0


def nothing_answers(table: Table) -> Table:
    """Return other quantities in place of positions and commands."""
    rng = np.random.default_rng(1)
    walks = 0.003 * rng.standard_normal((5, len(table["t"]))).cumsum(axis=1)
    return {**table, **dict(zip(("x", "y", "wx", "wy", "wl"), 0.4 + walks, strict=True))}


USELESS: dict[str, tuple[Callable[[Table], Table], MeasuredMap, str]] = {
    "nothing answers": (nothing_answers, VELOCITY, "this log is of no use: no signal answers another"),
    "nothing moves": (
        lambda table: {n: v if n == "t" else np.full_like(v, v[0]) for n, v in table.items()},
        VELOCITY,
        "no signal moves together with another, so nothing was checked",
    ),
    "nothing to compare": (
        lambda table: table,
        mapping({"alpha": None, "beta": None}),
        "nothing was checked: the map has neither angles nor commands",
    ),
}


@pytest.mark.parametrize("case", USELESS)
def test_a_log_of_no_use_is_told_and_why(case: str, tmp_path: Path) -> None:
    change, settings, expected = USELESS[case]
    result = imported(write_csv(tmp_path / "a.csv", change(columns())), mapping=settings)
    assert [remark for remark in result.remarks if expected in remark], result.remarks
    useful = imported(write_csv(tmp_path / "b.csv", columns()), mapping=VELOCITY)
    assert useful.remarks == ()


def test_missing_readings_are_named_with_their_place(tmp_path: Path) -> None:
    table = columns()
    beta = table["beta"].copy()
    beta[[400, 401, 900]] = [np.nan, np.inf, -np.inf]
    path = write_csv(tmp_path / "a.csv", {**table, "beta": beta})
    (remark,) = imported(path, mapping=mapping()).remarks
    assert remark.startswith("3 of 2001 readings of beta are no numbers and left out, the first (nan) at 2 s")


def test_a_bridged_gap_is_not_a_late_answer(tmp_path: Path) -> None:
    """The line between two readings of beta answers nothing, early or late."""
    table = columns()
    time = table["t"]
    missing = (time > 1.9) & (time < 2.5)
    path = write_csv(tmp_path / "a.csv", {**table, "beta": np.where(missing, np.nan, table["beta"])})
    result = imported(path, mapping=mapping(time={"column": "t", "max_gap": 0.7}))
    assert all(abs(finding.delay) < 0.002 for finding in result.findings)
    assert all(finding.correlation > 0.999 for finding in result.findings)


def test_constants_of_a_planar_rig_are_no_findings(tmp_path: Path) -> None:
    """Nobody asks whether a constant is mapped right; a column that does not move is told."""
    path = write_csv(tmp_path / "a.csv", columns() | {"beta": np.zeros(len(columns()["t"]))})
    planar = {"bridge_position": {"column": None, "value": 0.0}}
    both = imported(path, mapping=mapping(planar | {"beta": {"column": None, "value": 0.0}}))
    assert [finding.signal for finding in both.findings] == ["alpha"]
    one = imported(path, mapping=mapping(planar))
    assert any("beta or bridge_position hardly moves" in finding.text for finding in one.findings)


def test_a_negative_gain_is_always_told() -> None:
    """Also where noise hides so much of the answer that no mistake is found."""
    rig = RigFile.load("lab-rig")
    table = noisy(record(rig, moves(rig, 5)), np.random.default_rng(0), 0.0, 0.02)
    table["beta"] = -table["beta"]
    settings = mapping()
    recording = recorded(table, settings)
    verdict = check_physics([recording], settings, rig)
    (beta,) = [finding for finding in verdict.findings if finding.signal == "beta"]
    assert beta.gain < 0.0
    assert any("beta" in text for text in verdict.contradictions) or "a negative gain" in beta.text


def test_wrong_units_of_the_bridge_are_refused_with_their_factor(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", columns())
    with pytest.raises(InputError) as error:
        imported(path, mapping=mapping({"bridge_position": {"unit": "mm"}}))
    assert "bridge_position is 1000 times too small" in error.value.found
    assert "write signals.bridge_position.unit = 'm'" in error.value.remedy


def test_a_recording_without_trusted_samples_says_nothing() -> None:
    table = record(RigFile.load("lab-rig"), moves(RigFile.load("lab-rig"), 5))
    log = recorded(table, VELOCITY)
    verdict = check_physics(
        [Recording(log.columns, log.period, np.zeros(len(log.trusted), dtype=np.bool_))],
        VELOCITY,
        RigFile.load("lab-rig"),
    )
    assert verdict.contradictions == ()
    assert set(SIGNALS) >= {finding.signal for finding in verdict.findings}
