"""The page on measured cranes states what the proof of identification found."""

import json

import numpy as np

from tests.conftest import ROOT
from validation.proofs.identification import CLEAN_KIND, DATA, SEED, data_text, drawn_rig, summary

PAGE = (ROOT / "docs" / "explanation" / "measured.md").read_text(encoding="utf-8")
RESULTS = json.loads(DATA.read_text(encoding="utf-8"))


def statistics(kind: str) -> list[float]:
    return [statistic for _, name, _, statistic in RESULTS["verdicts"] if name == kind]


def test_false_alarms_and_detections_are_those_of_the_proof() -> None:
    words = summary(RESULTS)
    kinds = dict.fromkeys(kind for _, kind, _, _ in RESULTS["verdicts"])
    assert len(kinds) == 11
    for kind in kinds:
        assert f"| {kind} | {words[f'not covered, {kind}']} |" in PAGE
    smallest = {kind: min(statistics(kind)) for kind in kinds if kind != CLEAN_KIND}
    least = min(smallest, key=lambda kind: smallest[kind])
    assert (
        f"The largest ratio of an unchanged crane was {max(statistics(CLEAN_KIND)):.1f}, and the smallest "
        f"of a changed one {smallest[least]:.1f}, of {least}."
    ) in " ".join(PAGE.split())


def test_answers_with_a_tolerance_are_those_of_the_proof() -> None:
    words = summary(RESULTS)
    assert f"{words['imperfect cranes']} of these cranes" in PAGE
    for name in (
        "unchanged and within",
        "changed by twice the tolerance and not covered",
        "false within",
        "false covered",
        "not decided",
    ):
        assert f"| {name} | {words[name]} |" in PAGE
    assert words["false within"] == words["false covered"] == "0"


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
        "gains": "gain",
        "Coulomb friction of the axes": "friction.coulomb",
        "mass of the load": "load_mass",
        "zero of the rope's length": "rope_offset",
        "friction of the pivot": "pivot",
    }
    for row, part in rows.items():
        error = max(value for name, value in worst.items() if part in name)
        assert f"| {row} | {error:.2f} % |" in PAGE, row
    late = words["largest error of the dead time"].partition(" µs")[0]
    assert f"| dead time | {late} µs, times the root of the size |" in PAGE


def test_the_results_are_of_the_rigs_of_this_seed() -> None:
    assert RESULTS["seed"] == SEED
    for k, rig in enumerate(RESULTS["rigs"]):
        drawn = drawn_rig(np.random.default_rng([SEED, k]))
        assert rig["size"] == np.float64(f"{drawn.rope_range[1] / 1.4:.6g}")
    assert DATA.read_text(encoding="utf-8") == data_text(RESULTS)
