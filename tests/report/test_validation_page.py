"""The page of a validation: limits once, the right reason first, commands and motions in plain words."""

import re
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import pytest

from cranectl.cases import JudgedValue
from cranectl.cases.case import Case, CaseResult, Failure, RunSummary
from cranectl.cases.validation import Validation
from cranectl.cases.workers import CasesOutcome
from cranectl.compare.agreement import Agreement
from cranectl.metrics.limits import LimitVerdict
from cranectl.planning import load_scenario
from cranectl.report.page import Page, render
from cranectl.report.validation import ValidationPage, causes, scenario_verdicts
from cranectl.report.validation_input import motion_text
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.report.test_report import read_page

PLANTS = ("analytic", "elastic", "mujoco")
BROKEN = LimitVerdict("max_error_m", 0.6848, 0.5, kept=False)
KEPT = LimitVerdict("max_sway_rad", 0.01, 0.05, kept=True)
AGREE = Agreement("any", "lqr", "analytic", "mujoco", "ideal", 2e-9, 1e-9, 1e-7, 1e-7, True, "as shipped")


def run(plant: str, *limits: LimitVerdict, status: RunStatus = RunStatus.COMPLETED) -> RunSummary:
    return RunSummary("any", "lqr", plant, "ideal", status, 4.0, Path("logs/any.mcap"), None, limits)


def result(*runs: RunSummary, agreement: Agreement = AGREE) -> CaseResult:
    return CaseResult(runs, (agreement,), "completed")


def case(name: str = "ship-to-shore", controller: str = "lqr") -> Case:
    return Case.of(load_scenario(name), controller=controller, plants=PLANTS)


def validation(*outcomes: tuple[Case, CaseResult | Failure], **unloaded: Failure) -> Validation:
    cases, results = zip(*outcomes, strict=True)
    return Validation(cases, CasesOutcome(list(results), interrupted=False), unloaded, PLANTS)


def page_of(made: Validation) -> tuple[Page, str]:
    page = ValidationPage.of(made, ["--set", "rig.load_mass=2"], "cranectl validate")
    return page, read_page(render(page)).text


@pytest.mark.parametrize(
    ("name", "motion"),
    [
        ("ship-to-shore", "20 t, 37.7 m in 32 s"),
        ("workshop-move", "5 t, 19.1 m in 45 s"),
        ("settled-trajectory", "1 kg, 5.86 m in 20 s"),
        ("near-slack", "1 kg, 0.9 m in 1.1 s"),
        ("fixed-position", "1 kg, held in place for 25 s"),
    ],
)
def test_a_motion_in_words(name: str, motion: str) -> None:
    assert motion_text(load_scenario(name)) == motion


def test_a_limit_is_judged_once_on_the_reference_plant() -> None:
    values = list(JudgedValue.of_case(result(*(run(plant, BROKEN, KEPT) for plant in PLANTS))))
    error, sway, plants = values
    assert {v.key: v.kept for v in values} == {"max_error_m": False, "max_sway_rad": True, "plants": True}
    assert error.fault == "Largest tracking error of the load is 684.8 mm, the limit is 500 mm."
    assert (sway.measured, sway.limit) == ("0.573°", "2.865°")
    assert (plants.measured, plants.limit) == ("2.00 nm", "100 nm")
    made, text = page_of(validation((case(), result(*(run(plant, BROKEN, KEPT) for plant in PLANTS)))))
    assert made.first_screen is not None
    assert [fact.value for fact in made.first_screen.facts if fact.name == "Limits kept"] == ["1 of 2"]
    assert text.count("684.8 mm, the limit") == 1
    assert "max_error_m" not in text


def test_a_limit_that_only_another_plant_breaks_names_that_plant() -> None:
    fine = replace(BROKEN, value=0.4999, kept=True)
    (value, _) = JudgedValue.of_case(result(run("elastic", BROKEN), run("mujoco", fine)))
    assert value.fault.startswith("Largest tracking error of the load (elastic) is 684.8 mm")
    own = LimitVerdict("min_rope_tension_n", None, 1000.0, kept=False)
    (value, _) = JudgedValue.of_case(result(run("elastic", own), run("mujoco")))
    assert value.fault == "Smallest tension of the rope (elastic) is missing, the limit is 1 kN."
    assert value.sign == "≥"


APART = replace(AGREE, max_angle_error_rad=3e-6, passed=False, curing_step_s=0.001)
REFUSED = InputError("rig.load_mass is -2", allowed="positive masses", remedy="set rig.load_mass")


@pytest.mark.parametrize(
    ("outcome", "expected"),
    [
        (  # a run that ends early is the reason, not its limits
            result(run("analytic", BROKEN), run("mujoco", BROKEN, status=RunStatus.SLACK_ROPE)),
            [f"The run on mujoco ended at 4 s with slack-rope: {RunStatus.SLACK_ROPE.explanation}."],
        ),
        (
            result(run("mujoco", KEPT), agreement=APART),
            [
                "Difference of angles between analytic and mujoco is 3.00 µrad, the limit is 100 nrad.",
                "With control.physics_step = 0.001 the plants agree.",
            ],
        ),
        (
            result(run("mujoco"), agreement=replace(AGREE, passed=False)),
            ["The runs on analytic and mujoco end in different ways, or at different times."],
        ),
        (
            Failure.of(REFUSED),
            ["It could not be run: rig.load_mass is -2. Remedy: set rig.load_mass."],
        ),
        (
            Failure("ZeroDivisionError: of our own making", bad_input=False),
            ["ZeroDivisionError: of our own making"],
        ),
    ],
)
def test_the_reasons_are_sentences(outcome: CaseResult | Failure, expected: list[str]) -> None:
    (scenario,) = scenario_verdicts(validation((case(), outcome)))
    assert causes(scenario.cases[0]) == expected


def test_the_worst_scenario_is_first_and_each_has_a_command() -> None:
    broken = result(*(run(plant, BROKEN) for plant in PLANTS))
    fine = result(*(replace(run(plant, KEPT), log=None) for plant in PLANTS))
    made = validation((case("workshop-move"), fine), (case(), fine), (case(controller="pid"), broken))
    page, text = page_of(made)
    titles = [section.title for section in page.sections]
    assert titles[:3] == ["FAIL: ship-to-shore", "PASS: workshop-move", "Cases"]
    assert "1 of 2 scenarios fails. ship-to-shore: Largest tracking error" in text
    assert "1 of 3 cases fail" in text
    assert ValidationPage.worst_logs(made) == {"ship-to-shore": Path("logs/any.mcap")}
    assert "cranectl report logs/any.mcap" in text
    again = "cranectl run workshop-move --controller lqr --drive ideal --plants analytic,elastic,mujoco"
    assert f"{again} --set rig.load_mass=2" in text


def test_of_many_cases_that_fail_the_least_are_folded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cranectl.report.validation.SHOWN", 1)
    worse = replace(BROKEN, value=2.0)
    outcomes = [(case(controller=name), result(run("mujoco", limit))) for name, limit in
                (("pid", BROKEN), ("lqr", worse))]  # fmt: skip
    page, text = page_of(validation(*outcomes))
    (cases,) = (section for section in page.sections if section.anchor == "cases")
    assert [table.title for table in cases.tables] == ["", "1 more"]
    firsts = [table.rows[0][0].text for table in cases.tables]
    assert firsts == ["ship-to-shore, lqr, ideal", "ship-to-shore, pid, ideal"]
    assert "2 of 2 cases fail; the worst is lqr with ideal drives." in text


def test_the_page_tells_masses_and_at_its_foot_digest_and_version() -> None:
    outcome = result(run("mujoco", KEPT))
    heavier = Case.of(load_scenario("ship-to-shore", overrides=["rig.load_mass=15e3"]), plants=PLANTS)
    digests = set()
    for made in (case(), case(), case(controller="pid"), heavier):
        page, text = page_of(validation((made, outcome)))
        assert page.first_screen is not None
        facts = {fact.name: fact for fact in page.first_screen.facts}
        load = "15 t" if made is heavier else "20 t"
        assert (facts["Load"].value, facts["Load"].remark) == (load, "trolley 25 t, bridge 600 t")
        made_with = {row[0].text: row[1].text for row in page.sections[-1].tables[0].rows}
        assert made_with["cranectl"].startswith(f"{version('cranectl')}, sources ")
        digest = made_with["digest of all that was judged"]
        assert re.fullmatch("[0-9a-f]{16}", digest)
        assert digest in text
        assert all(shown in text for fact in facts.values() for shown in (fact.value, fact.remark))
        digests.add(digest)
    assert len(digests) == 3, "one for each input"
    _, text = page_of(validation((case(), outcome), (case("workshop-move"), outcome)))
    assert "Load 20 t, trolley 25 t, bridge 600 t." in text
    assert "Load 5 t, trolley 1.2 t, bridge 9 t." in text


def test_a_page_of_what_passes() -> None:
    page, text = page_of(validation((case(), result(*(run(plant, KEPT) for plant in PLANTS)))))
    assert page.first_screen is not None
    assert page.first_screen.verdict.text == "PASS"
    assert page.title == load_scenario("ship-to-shore").title
    assert page.lead == "Ship-to-shore crane: 20 t, 37.7 m in 32 s"
    assert "The scenario passes: runs end as expected, the plants agree, all limits are kept." in text
    alone = CaseResult((run("mujoco"),), (), "completed")
    _, text = page_of(validation((case(), alone)))
    assert "The scenario passes: runs end as expected." in text, "nothing else is judged"


def test_an_interrupted_validation_has_no_verdict() -> None:
    """Neither the case that was interrupted nor those after it are failures."""
    stopped = run("mujoco", status=RunStatus.INTERRUPTED)
    cases = (case(), case(controller="pole-placement"), case(controller="lqr+hinf"))
    results = [result(run("analytic", KEPT)), result(stopped), None]
    made = Validation(cases, CasesOutcome(results, interrupted=True), {}, PLANTS)
    assert made.interruption == "interrupted after 1 of 3 cases: no verdict"
    assert made.to_json(passed=False)["interrupted"]
    assert len(made.agreements) == 1
    _, text = page_of(made)
    assert "The validation was interrupted after 1 of 3 cases: no verdict." in text
    done = validation((case(), result(run("analytic", KEPT))))
    assert done.interruption == ""
