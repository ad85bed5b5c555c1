"""Reports: self-contained pages whose figures and sentences say what the runs did."""

import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cranectl.cases.case import RunSummary
from cranectl.cases.drive_use import drive_uses
from cranectl.cli.main import main
from cranectl.compare.agreement import judge
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.metrics import run_metrics
from cranectl.metrics.limits import LimitVerdict
from cranectl.planning import load_scenario
from cranectl.report.page import Figure, Page, Section, render
from cranectl.report.run.figures import Family, RunCurve
from cranectl.report.run.first_screen import first_screen_of
from cranectl.report.run.page import LogPage
from cranectl.report.table import Cell, Table
from cranectl.report.theme import Chart
from cranectl.signals import SignalGroup
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.colours import Palette
from cranectl.tools.render.opengl import no_opengl
from tests.conftest import PAIR, closed_loop, cut

pytestmark = pytest.mark.usefixtures("in_empty_directory")

SHORT = ["--set", "duration=0.5", "--set", "disturbances=[]"]


class Reader(HTMLParser):
    """Collects what a page is made of, and whether its elements are closed in order."""

    VOID = ("meta", "link", "br", "img")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: Counter[str] = Counter()
        self.references: list[str] = []
        self.tags: Counter[str] = Counter()
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids[str(value)] += 1
            if name in ("href", "xlink:href", "src"):
                self.references.append(str(value))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] not in (["style"], ["script"]):
            self.text += data


def read_page(html: str) -> Reader:
    """The page, checked to be well formed and to need nothing but itself."""
    reader = Reader()
    reader.feed(html)
    assert not reader.open
    assert set(reader.ids.values()) <= {1}, reader.ids.most_common(3)
    links = [reference for reference in reader.references if not reference.startswith("data:image/png;")]
    assert {link[0] for link in links} <= {"#"}
    assert {link[1:] for link in links} <= set(reader.ids)
    assert set(re.findall(r"url\(#([^)]*)\)", html)) <= set(reader.ids)
    assert reader.tags["script"] == 1
    assert not re.search(r"\b(fetch|import|XMLHttpRequest|eval)\b|https?://(?!www\.w3\.org/)", html)
    assert "@import" not in html
    assert not [stand_in for stand_in in Chart.STAND_IN.values() if stand_in in html]
    return reader


def curves(runs: dict[str, Run]) -> list[RunCurve]:
    return [RunCurve("lqr", "series-1", run, wide=plant == "analytic") for plant, run in runs.items()]


@pytest.fixture(scope="module")
def runs() -> dict[str, Run]:
    """Half a second with disturbances; no test may change it."""
    starts = ["disturbances.0.start=0.1", "disturbances.1.start=0.2"]
    scenario = load_scenario("fixed-position", overrides=["duration=0.5", *starts])
    made = {plant: simulate_run(scenario, plant=plant, controller="lqr") for plant in PAIR}
    for run in made.values():
        run.table.flags.writeable = False
    return made


# Families of figures of simulated runs, and the groups that only measured and predicted runs have.
SIMULATED = [name for name, family in Family.ALL.items() if family.group not in ("axes", "residual")]
MEASURED_GROUPS = {
    "axes": SignalGroup.measured("", angles=False, load=False),
    "residual": (SignalGroup.RESIDUAL,),
}


def with_signals(name: str, runs: dict[str, Run]) -> dict[str, Run]:
    """The runs, with the groups of signals that the family of figures shows."""
    if (groups := MEASURED_GROUPS.get(Family.ALL[name].group)) is None:
        return runs
    width = sum(map(len, groups))
    return {
        plant: replace(run, table=run.table[:, :width], reference=run.reference[:, :0], own_groups=groups)
        for plant, run in runs.items()
    }


def family_svg(family: Family, curves: list[RunCurve]) -> str:
    return Figure.drawn(family.title, "", family.draw, family, curves).svg


@pytest.mark.parametrize("name", Family.ALL)
def test_a_figure_shows_all_plants_in_colours_of_the_page_and_is_the_same_each_time(
    name: str, runs: dict[str, Run]
) -> None:
    family, runs = Family.ALL[name], with_signals(name, runs)
    svg = family_svg(family, curves(runs))
    ElementTree.fromstring(svg)
    assert set(re.findall(r"(?:fill|stroke): ([^;\"]+)", svg)) <= {
        "none",
        *(f"var(--{c})" for c in Palette.LIGHT),
    }
    assert svg == family_svg(family, curves(runs))
    plain = re.sub('<tspan dy=".25em"[^>]*>(.*?)</tspan><tspan.*?</tspan>', r"_\1", svg)
    for text in ("analytic", "MuJoCo", "lqr", *(panel.label for panel in family.panels)):
        assert f">{text}<" in plain
    assert not re.search(r"<text[^>]*>[^<]*_", svg)
    if family.draw.__name__ == "_over_time":
        lines = re.findall(r"<path[^>]*stroke: var\(--series-1\)", svg)
        assert len(lines) == 2 * len(family.panels) + 1, "both plants in each panel, and the legend"


@pytest.mark.parametrize("name", Family.ALL)
def test_the_difference_that_a_figure_states_is_that_of_its_curves(name: str, runs: dict[str, Run]) -> None:
    family, run = Family.ALL[name], with_signals(name, runs)["mujoco"]
    assert family.largest_difference(run, run) == 0.0
    moved = replace(run, table=run.table + 0.5)
    size = {"°": 180.0 / np.pi, "mm": 1e3}.get(family.panels[0].unit, 1.0)
    if name != "relative-path":  # load and trolley move together
        assert family.largest_difference(run, moved) == pytest.approx(0.5 * size)
    apart = LogPage.agreement(family, [(run, run), (run, replace(run, table=2.0 * run.table))], "apart by")
    assert re.fullmatch(r"apart by [\d.]+\D*", apart.replace("\N{NO-BREAK SPACE}", " ")), apart
    assert family.panels[0].unit in apart
    small = LogPage.agreement(family, [(run, replace(run, table=run.table * (1.0 + 1e-14)))], "apart by")
    expected = {"°": "rad", "mm": "m"}.get(family.panels[0].unit, family.panels[0].unit)
    assert small.replace("\N{NO-BREAK SPACE}", " ") == f"apart by < 1 n{expected}"


def test_limits_are_drawn_where_the_run_comes_near_them(runs: dict[str, Run]) -> None:
    assert "end of the rig" not in family_svg(Family.ALL["trolley"], curves(runs))
    far = {"mujoco": closed_loop("settled-trajectory", "pole-placement", "mujoco")}
    assert "end of the rig" in family_svg(Family.ALL["trolley"], curves(far))


@pytest.mark.parametrize("name", [name for name in Family.ALL if name != "space"])
def test_rounding_is_a_flat_line_and_a_nanometre_is_not(name: str, runs: dict[str, Run]) -> None:
    """Whatever the plants differ in can be seen; what only rounding moves has the axis of a constant."""
    family, run = Family.ALL[name], with_signals(name, runs)["mujoco"]
    wave = np.sin(np.arange(run.table.size)).reshape(run.table.shape)
    for level, size, flat in ((0.0, 1e-13, True), (0.7, 1e-13, True), (0.7, 1e-9, False)):
        moved = replace(run, table=level + size * wave, reference=level + 0.0 * run.reference)
        drawn = family.draw(family, curves({"mujoco": moved}))
        drawn.draw_without_rendering()
        spans = [high - low for axes in drawn.axes for low, high in (axes.get_xlim(), axes.get_ylim())]
        assert (min(spans) > 0.03) == flat


def said(name: str, **runs: Run) -> str:
    return LogPage.caption(Family.ALL[name], runs).replace("\N{NO-BREAK SPACE}", " ")


def test_sentences_say_what_the_run_did() -> None:
    run, good = (closed_loop("settled-trajectory", name, "mujoco") for name in ("pole-placement", "lqr"))
    final = np.linalg.norm(run.reference[-1, :3] - run.load_position[-1])
    assert said("error", any=run) == f"Load off its reference at the end: {1e3 * final:.0f} mm."
    assert "past the end of the rig, from 15.75 s on" in said("trolley", PP=run)
    assert said("trolley", LQR=good) == "All stay within the rig."
    largest = np.abs(run.block("input")[:, :3]).max(axis=0)
    assert run.block("input")[:, 2].min() == -largest[2], "a size, whatever its sign"
    inputs = f"trolley: {1e3 * largest[:2].max():.0f} mm/s²; of the rope: {1e3 * largest[2]:.1f} mm/s²"
    assert inputs in said("input", any=run)
    both = said("angles", PP=run, LQR=good)
    for label, each in (("PP", run), ("LQR", good)):
        assert f"{np.degrees(np.abs(each.angles).max()):.2f}° ({label})" in both


def test_what_comes_from_users_is_escaped() -> None:
    table = Table("<b>", ("<i>",), ((Cell("<script>"),),), note="a & b")
    figure = Figure("<u>", "<svg></svg>", "x < y")
    page = Page("<title>", "lead", (Section("a", "A", ("<p>",), (table,), (figure,)),), "cranectl report <x>")
    html = render(page)
    reader = read_page(html)
    for text in ("<b>", "<i>", "<script>", "a & b", "<u>", "x < y", "<title>", "<x>"):
        assert text in reader.text
    assert reader.tags["svg"] == 1


def test_report_of_logs(capsys: pytest.CaptureFixture[str]) -> None:
    for drive in ("ideal", "velocity"):
        arguments = ["run", "fixed-position", *SHORT, "--plants", "analytic,mujoco", "--drive", drive]
        arguments += ["--out", f"{drive}/run.mcap"]
        assert main(arguments) == 0
    assert main(["report", "ideal/run.mcap"]) == 0
    assert f"report: {Path('ideal/run.html')}" in capsys.readouterr().out
    first = Path("ideal/run.html").read_bytes()
    assert main(["report", "ideal/run.mcap"]) == 0
    assert Path("ideal/run.html").read_bytes() == first
    one = read_page(first.decode())
    assert one.tags["figure"] == len(SIMULATED) + 2
    assert (one.tags["svg"], one.tags["img"]) == (len(SIMULATED) + 1, 1)
    for text in (
        "the load is farthest from its reference.",
        "PLANTS AGREEThe plants agree: their loads differ by less than 1 nm (allowed: 100 nm).",
        "Hold the load in the middle of the rig",
        "pole-placement with ideal drives, on analytic, mujoco",
        "mujoco minus analytic",
    ):
        assert text in one.text
    assert re.search(r"\bpm\b", one.text) is None, "a picometre is rounding"
    assert main(["report", "ideal/run.mcap", "velocity/run.mcap", "--out", "two.html"]) == 0
    two = read_page(Path("two.html").read_text())
    for text in (
        "ideal/run",
        "velocity/run",
        "analytic, mujoco: velocity/run minus ideal/run",  # at rest: both differ by rounding only
        "limit, ideal drives",
        "limit, velocity drives",
        "ideal/run, velocity/run: pole-placement with ideal and velocity drives",
    ):
        assert text in two.text
    assert "not judged" not in two.text
    assert two.text.count("plants agree in all 2 logs") == 2, "in the verdict and below the figure"


def test_report_of_one_plant_whose_run_stopped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def nothing() -> None:
        raise no_opengl({"egl": "no screen"})

    monkeypatch.setattr("cranectl.tools.render.draw.check_engine", nothing)
    stop = ["--set", "disturbances=[{joint='alpha', start=0.1, magnitude=20.0}]", "--set", "duration=2"]
    assert main(["run", "fixed-position", *stop, "--plant", "mujoco", "--out", "one.mcap"]) == 3
    assert main(["report", "one.mcap"]) == 0
    page = read_page(Path("one.html").read_text())
    without = "No picture of the crane: no OpenGL to draw with. Tried MUJOCO_GL=egl: no screen"
    assert without in page.text
    assert without in capsys.readouterr().out
    assert (page.tags["figure"], page.tags["img"]) == (len(SIMULATED), 0)
    assert "length-singular" in page.text
    assert re.search(r"drives the trolley [\d.]+ m past the end of the rig, from 0\.\d\d s on", page.text)
    assert re.search(r"FAILThe run on mujoco ended at 0\.\d+ s with length-singular\.", page.text)


def test_a_run_whose_last_sample_holds_what_stopped_it_is_logged_and_reported(
    tmp_path: Path, runs: dict[str, Run]
) -> None:
    """It is written, read, reported and compared like any other, and no verdict calls it good."""
    ended = []
    for run, value in zip(runs.values(), (-np.inf, np.nan), strict=True):
        broken = replace(run, table=run.table.copy())
        broken.table[204] = value
        ended.append(cut(broken, 205, status=RunStatus.ENGINE_WARNING, end_ns=204_000_000))
    log = {run.plant: run for run in ended}
    back = read_log(write_log(tmp_path / "a.mcap", ended))
    assert np.array_equal(back["mujoco"].table[-1], log["mujoco"].table[-1], equal_nan=True)
    page = read_page(render(LogPage.of({"a": back, "b": {"mujoco": back["mujoco"]}}, "")))
    assert "engine-warning" in page.text
    assert re.search(r"Load off its reference at the end: (nan|inf)\sm", page.text)
    assert "FAIL" in page.text
    assert "PASS" not in page.text


def test_report_of_a_run_without_a_sample(runs: dict[str, Run]) -> None:
    run, empty = runs["mujoco"], cut(runs["mujoco"], 0)
    page = read_page(render(LogPage.of({"a": {"analytic": empty, "mujoco": empty}}, "")))
    assert page.tags["figure"] == 0
    half = read_page(render(LogPage.of({"a": {"analytic": empty, "mujoco": run}}, "")))
    assert half.tags["figure"] == len(SIMULATED)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["no.mcap"], "cannot read no.mcap"),
        (["a.mcap"] * 5, "5 logs"),
        (["--figures", "file/below"], "cannot write figures into file/below"),
    ],
)
def test_wrong_input_is_refused_before_anything_is_computed(
    arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("file").write_text("")
    assert main(["report", *arguments]) == 2
    assert expected in capsys.readouterr().err


def test_each_figure_of_a_report_is_saved_as_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "fixed-position", *SHORT, "--plant", "mujoco", "--out", "run.mcap"]) == 0
    assert main(["report", "run.mcap", "--figures", "a/b"]) == 0
    assert f"figures: {len(SIMULATED) + 1} files in {Path('a/b')}" in capsys.readouterr().out
    files = {path.name: path.read_bytes() for path in Path("a/b").iterdir()}
    assert len(files) == len(SIMULATED) + 1
    assert {"tracking-error.svg", "the-crane-at-its-worst-moment.png"} < set(files)
    for name, content in files.items():
        if name.endswith(".png"):
            assert content.startswith(b"\x89PNG")
            continue
        root = ElementTree.fromstring(content)
        assert min(float(root.attrib[side]) for side in ("height", "width")) > 0.0
        assert b"var(" not in content
        assert set(re.findall(rb"(?:fill|stroke): ([^;\"]+)", content)) <= {
            b"none",
            *map(str.encode, Palette.LIGHT.values()),
        }
    assert main(["report", "run.mcap", "--figures", "a/b"]) == 0
    assert files == {path.name: path.read_bytes() for path in Path("a/b").iterdir()}
    Path("a/b/tracking-error.svg").write_text("my notes")
    assert main(["report", "run.mcap", "--figures", "a/b"]) == 2
    assert "it exists and is no SVG picture" in capsys.readouterr().err
    assert Path("a/b/tracking-error.svg").read_text() == "my notes"


def test_figures_of_equal_titles_have_files_of_their_own() -> None:
    figure = Figure("a & b", '<svg viewBox="0 0 4 3" style="x"><g fill="var(--block, none)"/></svg>', "")
    sections = (
        Section("a", "A", figures=(figure, figure)),
        Section("b", "B", figures=(replace(figure, number="5.1"),)),
    )
    assert Page("", "", sections, "").write_figures(Path()) == 3
    assert sorted(path.name for path in Path().iterdir()) == ["5.1-a-b.svg", "a-b-2.svg", "a-b.svg"]
    assert '<g fill="none"/>' in Path("a-b.svg").read_text()


def test_the_first_screen_says_the_verdict_and_why(runs: dict[str, Run]) -> None:
    good = judge(runs["analytic"], runs["mujoco"])
    kept = LimitVerdict("max_error_m", 0.01, 0.5, True)
    broken = LimitVerdict("max_sway_rad", 0.25, 0.2, False)
    far = replace(good, max_load_error_m=2e-3, passed=False)
    unjudged = replace(good, passed=None, limit_m=None, limit_rad=None, limits="nobody knows")
    none_left = LimitVerdict("saturated_s", 1.0, 0.0, False)
    too_much = "largest angle between rope and plumb line is 14.32°, the limit is 11.46°."
    nothing = "and the scenario sets no limits: there is nothing to judge."
    for judged, limits, badge, reason in (
        (good, (kept,), "PASS", "(allowed: 100 nm), and the limit is kept."),
        (
            good,
            (),
            "PLANTS AGREE",
            "(allowed: 100 nm). No limits are set: the table [limits] of the scenario "
            "adds a verdict on the controller.",
        ),
        (far, (), "FAIL", "Analytic and mujoco disagree: their loads differ by 2.00 mm (allowed: 100 nm)."),
        (good, (kept, broken, broken), "FAIL", f"1 of 2 limits are broken: {too_much}"),
        (
            good,
            (none_left, broken),
            "FAIL",
            f"2 of 2 limits are broken: {too_much[:-1]}; time during which a limit of any drive acts is 1 s, "
            "the limit is 0 s.",
        ),
        (unjudged, (), "not judged", "The difference between the plants is not judged: nobody knows."),
        (unjudged, (kept,), "PASS", "is not judged: nobody knows."),
        (None, (), "not judged", f"Only one plant was run, {nothing}"),
    ):
        summary = replace(RunSummary.of(runs["mujoco"], None), limits=limits)
        verdicts = {"a": [] if judged is None else [judged]}
        screen = first_screen_of({"a": {"mujoco": runs["mujoco"]}}, {"a": [summary]}, verdicts, {})
        assert screen.verdict.text == badge
        assert screen.reason == reason or (screen.reason.endswith(reason) and not reason[0].isupper())


def test_the_four_numbers_have_units_that_matter() -> None:
    run = closed_loop("settled-trajectory", "pole-placement", "mujoco")
    metrics = run_metrics(run)
    assert metrics is not None
    screen = first_screen_of({"a": {"mujoco": run}}, {"a": [RunSummary.of(run, None)]}, {"a": []}, {})
    error, sway, difference, drives = screen.facts
    assert error.value == f"{1e3 * metrics.max_error_m:.0f} mm"
    assert sway.value == f"{np.degrees(metrics.residual_sway_rad):.2f}°"
    assert (difference.value, difference.remark) == ("–", "only one plant to compare: mujoco")
    most = drive_uses(run)[0]
    assert drives.value == f"{100 * most.share:.0f} %"
    assert most.share == max(use.share for use in drive_uses(run))
    assert drives.remark.startswith(f"{most.axis}: ")
