"""Test what the benchmark's page begins with: pictures, three sentences, caveats, before and after tuning."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from cranectl.report.page import Section
from cranectl.tools.benchmark.ranking import Judged
from cranectl.tools.benchmark.report.page import benchmark_page
from cranectl.tools.benchmark.report.pictures import draw_set
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import BenchmarkTable, Runs
from tests.tools.benchmark.test_page import FACTS, runs, sections, table, texts

OURS = "lqr-offset-free"


def many(error: float, failures: int) -> Runs:
    """Return forty runs, of which `failures` failed."""
    one = runs(error)
    metrics = {name: np.tile(values, 5) for name, values in one.metrics.items()}
    return Runs(np.arange(40) < failures, ("completed",) * 40, metrics)


def both_divisions(benchmark: Benchmark, ours: float = 0.01) -> BenchmarkTable:
    """Return a table in which tuning helps `helped` and harms `harmed`."""
    published = {"helped": many(0.02, 30), "harmed": many(0.02, 1), OURS: many(ours, 0)}
    tuned = {"helped": many(0.02, 2), "harmed": many(0.02, 25), OURS: many(ours, 1)}
    tables = (table(benchmark, tuned, "tuned"), table(benchmark, published, "published"))
    return BenchmarkTable.join(tables)


def test_page_begins_with_pictures_and_has_caveats_above_tables(benchmark: Benchmark) -> None:
    shown = sections(benchmark, both_divisions(benchmark))
    first, second, third, fourth, *_ = shown
    assert (first, second, third, fourth) == ("result", "conclusions", "caveats", "before-after")
    titles = [figure.title for figure in shown[first].figures]
    assert titles == [
        "nominal: spread 0, 40 runs of each controller",
        "wide: spread 2, 40 runs of each controller",
    ]
    assert not any(shown[anchor].tables for anchor in (first, second, third))


def test_three_sentences_are_made_from_the_runs(benchmark: Benchmark) -> None:
    least, beaten, tuning = sections(benchmark, both_divisions(benchmark))["conclusions"].paragraphs
    assert least == (
        f"On wide, the set with the widest spread, {OURS} (ours) comes first: it fails in 2.5 % of 40 runs "
        "and is unsettled for 13.3 % of the time at rest; next is helped with 5.0 % and 26.1 %."
    )
    assert beaten.startswith(f"No controller beats {OURS} (ours) on any set")
    assert tuning == (
        "On wide, tuning makes 1 of 3 controllers fail more than chance explains, such as "
        "harmed 2.5 → 62.5 %, and 1 fail less."
    )


def test_page_names_the_controller_that_beats_ours_and_why(benchmark: Benchmark) -> None:
    results = table(benchmark, {OURS: runs(0.03, failures=1), "better": runs(0.01)}, "published")
    _, beaten, tuning = sections(benchmark, results)["conclusions"].paragraphs
    assert beaten == (
        f"better beats {OURS} (ours) on nominal, as published (defaults): it fails in 0.0 % of the runs, not "
        "12.5 %, is unsettled for 11.1 % of the time, not 41.7 %, and commands 1.000 m/s², not 1.000 m/s²."
    )
    assert tuning.startswith("Controllers ran in one division only")


def test_without_ours_the_page_names_the_undominated(benchmark: Benchmark) -> None:
    results = table(benchmark, {"first": runs(0.01), "second": runs(0.02)}, "published")
    shown = sections(benchmark, results)
    assert shown["conclusions"].paragraphs[1].endswith("effort on every set: first.")
    assert OURS not in "".join(shown["caveats"].paragraphs)


def caveats(shown: dict[str, Section]) -> str:
    return "\n".join(shown["caveats"].paragraphs)


def test_caveats_say_who_is_told_limits_and_whom_tuning_harms(benchmark: Benchmark) -> None:
    results = both_divisions(benchmark)
    results.about["laws"] |= {name: {**FACTS, "file": "", "rig": ["limits"]} for name in (OURS, "helped")}
    text = caveats(sections(benchmark, results))
    assert "offered to every controller. Ours uses them, as do helped; the other 1 do not." in text
    assert "Tuning harms 1 of 3 controllers on wide, in failures: harmed 2.5 → 62.5 %." in text
    assert "The tuning set never shows path." in text
    assert "1. We wrote lqr-offset-free ourselves." in text


def test_numbers_before_and_after_tuning_are_side_by_side(benchmark: Benchmark) -> None:
    wide, nominal = sections(benchmark, both_divisions(benchmark))["before-after"].tables
    assert (wide.folded, nominal.folded) == (False, True)
    rows = {row[0].text: row for row in wide.rows}
    assert [cell.text for cell in rows["harmed"][2:4]] == ["2.5", "62.5"]
    marks = {name: row[3].mark for name, row in rows.items()}
    assert marks == {"harmed": "bad", "helped": "good", f"{OURS} (ours)": ""}


@pytest.mark.parametrize("shared", [True, False])
def test_yours_is_marked_and_shown_where_scenarios_are_missing(small: Path, shared: bool) -> None:
    """With one of two scenarios it is not ranked, but stands in the table and in the picture."""
    text = small.read_text(encoding="utf-8")
    small.write_text(text.replace('suits = ["path"]\nset', 'suits = ["path", "set-point"]\nset'))
    benchmark = Benchmark.read("small.toml")
    results = table(benchmark, {"lqr-integral": runs(0.02), "mine": runs(0.01)}, "published", "tuned")
    trials = {trial: of for trial, of in results.trials.items() if trial[0] != "tuned" or trial[4] != "mine"}
    for trial in list(trials):
        if shared or trial.controller != "mine":
            trials[trial._replace(scenario="path")] = trials[trial]
    results = BenchmarkTable(results.about, trials)
    page = benchmark_page(benchmark, results, "cranectl benchmark report", yours={"mine"})
    shown = {section.anchor: section for section in page.sections}
    assert page.sections[0].title == "As published (defaults): failures and settling", "where yours has runs"
    assert all("mine (yours)" in figure.svg for figure in shown["result"].figures)
    rows = {row[0]: row for row in texts(shown["published-wide"].tables[0])}
    assert rows["mine (yours)"][2] == ("none" if shared else "ran 1 of 2 scenarios")
    assert rows["mine (yours)"][3:5] == ["16" if shared else "8", "0.0"]


def test_names_in_a_picture_cover_no_mark_and_no_other_name(benchmark: Benchmark) -> None:
    """All controllers fail alike and settle alike, which crowds their names."""
    names = [f"controller-{k}" for k in range(6)]
    results = table(benchmark, {name: runs(0.01) for name in names}, "published")
    drawing = draw_set(Judged(benchmark, results, "published", set(names)), "wide")
    heights = [text.xyann[1] for text in drawing.axes[0].texts]  # type: ignore[attr-defined]
    assert len(heights) == len(names)
    assert np.diff(np.sort(heights)).min() >= 10.0


def test_panels_of_all_sets_have_the_same_axes_and_hold_every_mark(benchmark: Benchmark) -> None:
    """Unsettled times are drawn on a logarithmic axis, failures up to the most of any set."""
    kinds = {"never": runs(4.0, failures=5), "at-once": runs(0.0), "usual": runs(0.1)}
    judged = Judged(benchmark, table(benchmark, kinds, "published"), "published", set())
    limits = set()
    for name in judged.ranked_sets:
        (axes,) = draw_set(judged, name).axes
        limits.add((axes.get_xscale(), axes.get_xlim(), axes.get_ylim()))
        (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        marks = [mark for line in axes.lines for mark in zip(*line.get_data(), strict=True)]
        assert len(marks) == len(kinds)
        assert all(low <= x <= high and bottom <= y <= top for x, y in marks)
    assert len(limits) == 1
    assert next(iter(limits))[0] == "log"


def test_controllers_that_never_settle_are_drawn_at_one_place(
    benchmark: Benchmark, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rounding may make their share of time a little more than 1, at which Matplotlib finds no range."""
    kinds = {"never": runs(4.0), "neither": runs(4.0)}
    judged = Judged(benchmark, table(benchmark, kinds, "published"), "published", set())
    points = np.array([[np.nextafter(1.0, 2.0), 1.0, 0.0]] * 2)
    monkeypatch.setattr("cranectl.tools.benchmark.report.pictures.points_of", lambda of: points[: len(of)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (axes,) = draw_set(judged, "wide").axes
    assert [round(float(line.get_xdata()[0]), 9) for line in axes.lines] == [100.0, 100.0]  # type: ignore[arg-type, index]


def test_place_on_a_front_by_effort_alone_is_named(benchmark: Benchmark) -> None:
    cheap, best = runs(0.03, failures=2, effort=0.1), runs(0.01, effort=1.0)
    results = table(benchmark, {"cheap": cheap, "best": best}, "published")
    rows = {row[0]: row[2] for row in texts(sections(benchmark, results)["summary"].tables[0])}
    assert rows == {"best": "all sets", "cheap": "all sets, by effort alone"}
