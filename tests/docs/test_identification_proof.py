"""The page on measured cranes states what the proof of identification found."""

import json

import numpy as np

from cranectl.measured.verdict import COVERED
from tests.conftest import ROOT
from validation.proofs.identification import CLEAN_KIND, DATA, SEED, data_text, drawn_rig, summary

PAGE = (ROOT / "docs" / "explanation" / "measured.md").read_text(encoding="utf-8")
RESULTS = json.loads(DATA.read_text(encoding="utf-8"))


def statistics(kind: str) -> list[float]:
    return [statistic for _, name, _, statistic in RESULTS["verdicts"] if name == kind]


def test_false_alarms_and_detections_are_those_of_the_proof() -> None:
    words = summary(RESULTS)
    kinds = dict.fromkeys(kind for _, kind, _, _ in RESULTS["verdicts"])
    assert f"| an unchanged crane | {words[f'not covered, {CLEAN_KIND}']} |" in PAGE
    changed = [kind for kind in kinds if kind != CLEAN_KIND]
    assert len(changed) == 10
    assert {words[f"not covered, {kind}"] for kind in changed} == {"12 of 12"}
    assert PAGE.count("| 12 of 12 each |") == 4
    smallest = min(min(statistics(kind)) for kind in changed)
    assert f"unchanged crane was {max(statistics(CLEAN_KIND)):.1f}, and the smallest of a changed one" in PAGE
    assert f"{smallest:.1f}, of a soft\nframe" in PAGE
    assert smallest == min(statistics("soft frame"))
    assert min(statistics("load under its hook")) > 30.0


def test_errors_of_the_numbers_are_those_of_the_proof() -> None:
    words = summary(RESULTS)
    assert words["converged"] == "12 of 12"
    assert f"{words['numbers inside their intervals']} numbers lay inside" in PAGE
    worst = {
        name: float(value.split()[0])
        for name, value in words.items()
        if name.startswith("largest error") and value.endswith("%")
    }
    rows = {
        "time constants": "time_constant",
        "Coulomb friction of the axes": "friction.coulomb",
        "mass of the load": "load_mass",
        "zero of the rope's length": "rope_offset",
    }
    for row, part in rows.items():
        error = max(value for name, value in worst.items() if part in name)
        assert f"| {row} | {error:.2f} % |" in PAGE, row
    assert max(value for name, value in worst.items() if "gain" in name) < 0.01
    assert f"| friction of the pivot | {max(v for n, v in worst.items() if 'pivot' in n):.1f} % |" in PAGE
    late = words["largest error of the dead time"].partition(" µs")[0]
    assert f"| dead time | {late} µs, times the root of the size |" in PAGE


def test_the_results_are_of_the_rigs_of_this_seed() -> None:
    assert RESULTS["seed"] == SEED
    for k, rig in enumerate(RESULTS["rigs"]):
        drawn = drawn_rig(np.random.default_rng([SEED, k]))
        assert rig["size"] == np.float64(f"{drawn.rope_range[1] / 1.4:.6g}")
    assert DATA.read_text(encoding="utf-8") == data_text(RESULTS)
    assert {answer for _, _, answer, _ in RESULTS["verdicts"]} == {COVERED, "not covered"}
