"""Each sentence of README and docs/explanation that promises a number names its condition."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from cranectl.compare.agreement import agreement_limits
from cranectl.plants.plant import DRIVES
from cranectl.plants.steps import SIZE_POWER, STEPS_PER_TIME, SWEPT_ROPE
from cranectl.scenario.run_settings import MAX_DEFAULT_STEP, MIN_DEFAULT_STEP
from tests.conftest import ROOT

PAGES = ["README.md", *(str(p.relative_to(ROOT)) for p in sorted((ROOT / "docs/explanation").glob("*.md")))]
NUMBER = re.compile(r"\b\d+(\.\d+)?(e-\d+)? ?(%|(m|mm|nm|µm|rad|times|ms|s|of)\b)")
PROMISE = re.compile(
    r"\b(agree|agrees|within|at most|at least|never|always|every|all|largest|holds?|bound|proven?|exact)\b"
)
# By page: the sentences that promise a number, by a part of them, and words of their condition.
CONDITIONS = {
    "README.md": {
        "All plants agree to 1e-7 m and rad": "a rigid rope and a point load without friction and encoders, "
        "if the loop is stable and the [steps are short enough]"
    },
    "docs/explanation/certificate.md": {
        "These are 45 points": "of the default rig with a delay of 10 ms",
        "For a load that hangs at 0.7 m": "without and with each [effect]",
        "the largest lag of all drives": "while the tracker compensates 20 ms",
    },
    "docs/explanation/measured.md": {"p is at least 5 %": "divided by the number of runs in the verdict"},
    "docs/explanation/planning.md": {"within 1.5 % of their bounds": "For the motions below"},
    "docs/explanation/validation.md": {
        "within 53 mm of its path": "With +2 l̇ β̇ in the analytic plant, `lqr`",
        "All plants agree to 1e-7 m and rad": "Without effects",
        "differ by at most 3.7e-8 m": "Within it, shipped scenarios of the laboratory rig",
        "A sweep gave this condition": "lags of 1 to 500 ms",
    },
}


def paragraphs(text: str) -> Iterator[str]:
    """Yield the prose of a page, a paragraph or item of a list at a time, without code and tables."""
    block: list[str] = []
    for line in [*re.sub(r"```.*?```", "", text, flags=re.DOTALL).splitlines(), ""]:
        is_prose = bool(line.strip()) and not line.startswith(("    ", "|", "#"))
        if block and (not is_prose or re.match(r"\s*([-*]|\d+\.) ", line)):
            yield " ".join(block)
            block = []
        if is_prose:
            block.append(line.strip())


def promises(paragraph: str) -> list[str]:
    """Return the sentences of a paragraph that promise a number."""
    sentences = re.split(r"(?<=[.!?:])\s+(?=[A-Z*`\[])", paragraph)
    return [sentence for sentence in sentences if NUMBER.search(sentence) and PROMISE.search(sentence)]


@pytest.mark.parametrize("page", PAGES)
def test_each_promise_of_a_number_has_its_condition_beside_it(page: str) -> None:
    known = CONDITIONS.get(page, {})
    used = set()
    for paragraph in paragraphs((ROOT / page).read_text(encoding="utf-8")):
        for sentence in promises(paragraph):
            named = [part for part in known if part in sentence]
            assert named, f"{page}: state the condition of this promise, and list it here: {sentence}"
            assert all(known[part] in paragraph for part in named), sentence
            used.update(named)
    assert used == set(known), "of a sentence that is no longer there"


def test_the_condition_of_agreement_is_the_one_that_default_steps_keep() -> None:
    """The formula and the limits of the pages are those of the code."""
    page = " ".join(Path(ROOT / "docs/explanation/validation.md").read_text(encoding="utf-8").split())
    assert (SIZE_POWER, f"/ {STEPS_PER_TIME:g} · min(1, ({SWEPT_ROPE:g} m / L)^¼)" in page) == (0.25, True)
    assert f"from {1e6 * MIN_DEFAULT_STEP:g} µs to {1e3 * MAX_DEFAULT_STEP:g} ms" in page
    for drive in DRIVES:
        limits = agreement_limits(drive)
        assert (limits.load_m, limits.angle_rad) == (1e-7, 1e-7)


def test_a_promise_without_a_condition_is_found() -> None:
    (sentence,) = promises("It is fast. All plants agree to 1e-7 m and rad. `lqr` is not.")
    assert sentence == "All plants agree to 1e-7 m and rad."
