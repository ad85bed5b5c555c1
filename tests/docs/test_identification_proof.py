"""The page on measured cranes states what the proof of identification found."""

import json
from pathlib import Path

import pytest

from cranectl.tools.measured.verdict import NOT_DECIDED
from tests.conftest import ROOT
from validation.proofs.hidden_cranes import CRANES, UNCHANGED, Crane, drawn_crane
from validation.proofs.identification import CALIBRATED, DATA, PARTS, write
from validation.proofs.identification_results import ENOUGH_SAMPLES, rows_of, summary, tolerated

PAGE = (ROOT / "docs" / "explanation" / "measured.md").read_text(encoding="utf-8")
TEXT = " ".join(PAGE.split())
RESULTS = json.loads(DATA.read_text(encoding="utf-8"))
WORDS = summary(RESULTS)


def test_the_results_are_whole_and_of_the_committed_cranes(tmp_path: Path) -> None:
    for part in PARTS:
        assert len(RESULTS["parts"][part]) == (CALIBRATED if part == "calibration" else CRANES), part
    for k in (0, CRANES - 1):
        drawn = drawn_crane(RESULTS["seed"], k, tmp_path)
        hidden = Crane.from_json(RESULTS["cranes"][k])
        assert drawn.size == pytest.approx(hidden.size)
        assert drawn.numbers == pytest.approx(hidden.numbers)
        assert drawn.flaws.names == hidden.flaws.names
    write(RESULTS, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == DATA.read_bytes()


def test_false_alarms_and_detections_are_those_of_the_proof() -> None:
    rows = rows_of(RESULTS, "exact")
    kinds = dict.fromkeys(row["kind"] for row in rows)
    assert len(kinds) == 10
    for kind in kinds:
        assert f"| {kind} | {WORDS[f'not covered, {kind}']} |" in PAGE
    assert WORDS["rate of false alarms"] == "as allowed"
    assert f"the rate of false alarms is {WORDS['false alarms']}" in TEXT
    least = min((row for row in rows if row["kind"] != UNCHANGED), key=lambda row: row["T"])
    largest = max(row["T"] for row in rows if row["kind"] == UNCHANGED)
    assert (
        f"The largest ratio of an unchanged crane was {largest:.1f}, and the smallest of a changed one "
        f"{least['T']:.1f}, of {least['kind']}."
    ) in TEXT
    assert f"A Kolmogorov-Smirnov test of {WORDS['calibration'].partition(' of ')[2]}" in TEXT
    evenness = WORDS["calibration"].split()[3]
    assert float(evenness) > 0.01
    assert f"from 0 to 1 ({evenness})" in TEXT


def test_answers_with_a_tolerance_are_those_of_the_proof() -> None:
    for condition, rows in tolerated(RESULTS).items():
        unchanged, runs = WORDS[f"{condition}, unchanged and within"].split(" of ")
        assert unchanged == runs or all(row["samples"] < ENOUGH_SAMPLES for row in rows), condition
        words = [
            WORDS[f"{condition}, {what}"]
            for what in (
                "unchanged and within",
                "changed by twice the tolerance and not covered",
                "decided of logs that are fast enough",
            )
        ]
        assert f"| {condition} | {' | '.join(words)} |" in PAGE
        assert WORDS[f"{condition}, false within"] == WORDS[f"{condition}, false covered"] == "0"
    for swing in (0, 1, 5):
        condition = f"start swings by {swing} mrad"
        assert f"{WORDS[f'not covered, {condition}']}" in TEXT.partition("without flaws whose load swings")[2]
    assert f"{WORDS['degenerate logs, right']} such logs" in TEXT


def test_nearly_all_runs_that_can_be_decided_are() -> None:
    rows = [row for part in ("exact", "imperfect", "periods", "starts") for row in rows_of(RESULTS, part)]
    fast = [row for row in rows if row["samples"] >= ENOUGH_SAMPLES]
    decided = sum(row["answer"] != NOT_DECIDED for row in fast)
    assert decided >= 0.95 * len(fast)
    assert f"{decided} of {len(fast)} runs with 20 samples in a swing were decided" in TEXT


def test_errors_of_the_numbers_are_those_of_the_proof() -> None:
    assert WORDS["converged"] == "12 of 12"
    inside, numbers = map(int, WORDS["numbers inside their intervals"].split(" of "))
    assert inside >= 153
    assert f"{inside} of {numbers} numbers lay inside" in TEXT
    worst = {
        name: float(value.split()[0])
        for name, value in WORDS.items()
        if name.startswith("largest error") and value.endswith("%")
    }
    rows = {
        "time constants": "time_constant",
        "gains": "gain",
        "Coulomb friction of the axes": "friction.coulomb",
        "mass of the load": "load_mass",
        "zero of the rope's length": "rope_offset",
        "friction of the pivot": "pivot",
    }
    for row, part in rows.items():
        error = max(value for name, value in worst.items() if part in name)
        assert f"| {row} | {error:.2f} % |" in PAGE, row
    late = WORDS["largest error of the dead time"].partition(" µs")[0]
    assert f"| dead time | {late} µs, times the root of the size |" in PAGE
