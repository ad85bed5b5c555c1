"""Reports: self-contained pages whose figures and sentences say what the runs did."""

import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.render.opengl import no_opengl
from cranectl.report.page import Figure, Page, Section, render
from cranectl.report.run.figures import FAMILIES, Family, RunCurve, largest_difference
from cranectl.report.run.page import agreement, caption, log_page
from cranectl.report.table import Cell, Table
from cranectl.report.theme import STAND_IN
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.colours import COLOURS
from tests.conftest import closed_loop, cut

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
    assert not [stand_in for stand_in in STAND_IN.values() if stand_in in html]
    return reader


def curves(runs: dict[str, Run]) -> list[RunCurve]:
    return [RunCurve("lqr", "series-1", run, wide=plant == "analytic") for plant, run in runs.items()]


@pytest.fixture
def runs(short: Scenario) -> dict[str, Run]:
    return {plant: simulate_run(short, plant=plant, controller="lqr") for plant in ("analytic", "mujoco")}


def family_svg(family: Family, curves: list[RunCurve]) -> str:
    return Figure.drawn(family.title, "", family.draw, family, curves).svg


@pytest.mark.parametrize("name", FAMILIES)
def test_a_figure_takes_its_colours_from_the_page_and_is_the_same_each_time(
    name: str, runs: dict[str, Run]
) -> None:
    svg = family_svg(FAMILIES[name], curves(runs))
    ElementTree.fromstring(svg)
    assert set(re.findall(r"(?:fill|stroke): ([^;\"]+)", svg)) <= {"none", *(f"var(--{c})" for c in COLOURS)}
    assert svg == family_svg(FAMILIES[name], curves(runs))
    for text in ("analytic", "MuJoCo", "lqr"):
        assert f">{text}<" in svg
    plain = re.sub('<tspan dy=".25em"[^>]*>(.*?)</tspan><tspan.*?</tspan>', r"_\1", svg)
    for panel in FAMILIES[name].panels:
        assert f">{panel.label}<" in plain
    assert not re.search(r"<text[^>]*>[^<]*_", svg)


def drawn_paths(svg: str, role: str) -> int:
    """Number of lines drawn in a colour, the legend's handle not counted."""
    return len(re.findall(rf"<path[^>]*stroke: var\(--{role}\)", svg)) - 1


@pytest.mark.parametrize("name", [name for name, f in FAMILIES.items() if f.draw.__name__ == "_over_time"])
def test_both_plants_are_in_every_panel(name: str, runs: dict[str, Run]) -> None:
    family = FAMILIES[name]
    assert drawn_paths(family_svg(family, curves(runs)), "series-1") == 2 * len(family.panels)
    assert drawn_paths(family_svg(family, curves(runs)[:1]), "series-1") == len(family.panels)


@pytest.mark.parametrize("name", FAMILIES)
def test_the_difference_that_a_figure_states_is_that_of_its_curves(name: str, runs: dict[str, Run]) -> None:
    family, run = FAMILIES[name], runs["mujoco"]
    assert largest_difference(family, run, run) == 0.0
    moved = replace(run, table=run.table + 0.5)
    expected = 0.5 * (180.0 / np.pi if name == "angles" else 1.0)
    if name != "relative-path":  # load and trolley move together
        assert largest_difference(family, run, moved) == pytest.approx(expected)
    apart = agreement(family, [(run, run), (run, replace(run, table=2.0 * run.table))], "apart by")
    assert re.fullmatch(r"apart by [\d.]+\D*", apart.replace("\N{NO-BREAK SPACE}", " ")), apart
    assert family.panels[0].unit in apart


def test_limits_are_drawn_where_the_run_comes_near_them(runs: dict[str, Run]) -> None:
    assert "end of the rig" not in family_svg(FAMILIES["trolley"], curves(runs))
    far = {"mujoco": closed_loop("settled-trajectory", "pole-placement", "mujoco")}
    assert "end of the rig" in family_svg(FAMILIES["trolley"], curves(far))


@pytest.mark.parametrize("name", [name for name in FAMILIES if name != "space"])
def test_rounding_is_a_flat_line_and_a_nanometre_is_not(name: str, runs: dict[str, Run]) -> None:
    """Whatever the plants differ in can be seen; what only rounding moves has the axis of a constant."""
    family, run = FAMILIES[name], runs["mujoco"]
    wave = np.sin(np.arange(run.table.size)).reshape(run.table.shape)
    for level, size, flat in ((0.0, 1e-13, True), (0.7, 1e-13, True), (0.7, 1e-9, False)):
        moved = replace(run, table=level + size * wave, reference=level + 0.0 * run.reference)
        drawn = family.draw(family, curves({"mujoco": moved}))
        drawn.draw_without_rendering()
        spans = [high - low for axes in drawn.axes for low, high in (axes.get_xlim(), axes.get_ylim())]
        assert (min(spans) > 0.03) == flat


def test_sentences_say_what_the_run_did() -> None:
    run = closed_loop("settled-trajectory", "pole-placement", "mujoco")
    final = np.linalg.norm(run.reference[-1, :3] - run.load_position[-1])
    plain = caption(FAMILIES["error"], {"any": run}).replace("\N{NO-BREAK SPACE}", " ")
    assert plain == f"Load off its reference at the end: {1e3 * final:.0f} mm."
    assert "past the end of the rig, from 15.75 s on" in caption(FAMILIES["trolley"], {"PP": run})
    largest = np.abs(run.block("input")[:, :3]).max(axis=0)
    inputs = caption(FAMILIES["input"], {"any": run}).replace("\N{NO-BREAK SPACE}", " ")
    assert run.block("input")[:, 2].min() == -largest[2], "a size, whatever its sign"
    assert (
        f"trolley: {1e3 * largest[:2].max():.0f} mm/s²; of the rope: {1e3 * largest[2]:.1f} mm/s²" in inputs
    )
    good = closed_loop("settled-trajectory", "lqr", "mujoco")
    assert caption(FAMILIES["trolley"], {"LQR": good}) == "All stay within the rig."
    both = caption(FAMILIES["angles"], {"PP": run, "LQR": good})
    for label, each in (("PP", run), ("LQR", good)):
        assert f"{np.degrees(np.abs(each.angles).max()):.2f}° ({label})" in both.replace(
            "\N{NO-BREAK SPACE}", " "
        )


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
    assert one.tags["figure"] == len(FAMILIES) + 2
    assert (one.tags["svg"], one.tags["img"]) == (len(FAMILIES) + 1, 1)
    assert "The load is farthest from its reference at" in one.text
    assert "run: plants at most" in one.text
    assert "mujoco minus analytic" in one.text
    assert main(["report", "ideal/run.mcap", "velocity/run.mcap", "--out", "two.html"]) == 0
    two = read_page(Path("two.html").read_text())
    for text in (
        "ideal/run",
        "velocity/run",
        "analytic, mujoco: velocity/run minus ideal/run",  # at rest: both differ by rounding only
        "limit, ideal drives",
        "limit, velocity drives",
    ):
        assert text in two.text
    assert "not judged" not in two.text


def test_report_of_one_plant_whose_run_stopped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def nothing() -> None:
        raise no_opengl({"egl": "no screen"})

    monkeypatch.setattr("cranectl.render.draw.check_engine", nothing)
    stop = ["--set", "disturbances=[{joint='alpha', start=0.1, magnitude=20.0}]", "--set", "duration=2"]
    assert main(["run", "fixed-position", *stop, "--plant", "mujoco", "--out", "one.mcap"]) == 3
    assert main(["report", "one.mcap"]) == 0
    page = read_page(Path("one.html").read_text())
    without = "No picture of the crane: no OpenGL to draw with. Tried MUJOCO_GL=egl: no screen"
    assert without in page.text
    assert without in capsys.readouterr().out
    assert (page.tags["figure"], page.tags["img"]) == (len(FAMILIES), 0)
    assert "length-singular" in page.text
    assert re.search(r"drives the trolley [\d.]+ m past the end of the rig, from 0\.\d\d s on", page.text)


def test_a_run_whose_last_sample_holds_what_stopped_it_is_logged_and_reported(
    tmp_path: Path, runs: dict[str, Run]
) -> None:
    """It is written, read, reported and compared like any other, and no verdict calls it good."""
    ended = []
    for run, value in zip(runs.values(), (-np.inf, np.nan), strict=True):
        run.table[204] = value
        ended.append(cut(run, 205, status=RunStatus.ENGINE_WARNING, end_ns=204_000_000))
    log = {run.plant: run for run in ended}
    back = read_log(write_log(tmp_path / "a.mcap", ended))
    assert np.array_equal(back["mujoco"].table[-1], log["mujoco"].table[-1], equal_nan=True)
    page = read_page(render(log_page({"a": back, "b": {"mujoco": back["mujoco"]}}, "")))
    assert "engine-warning" in page.text
    assert re.search(r"Load off its reference at the end: (nan|inf)\sm", page.text)
    assert "FAILED" in page.text
    assert "passed" not in page.text


def test_report_of_a_run_without_a_sample(runs: dict[str, Run]) -> None:
    run, empty = runs["mujoco"], cut(runs["mujoco"], 0)
    page = read_page(render(log_page({"a": {"analytic": empty, "mujoco": empty}}, "")))
    assert page.tags["figure"] == 0
    half = read_page(render(log_page({"a": {"analytic": empty, "mujoco": run}}, "")))
    assert half.tags["figure"] == len(FAMILIES)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["no.mcap"], "cannot read no.mcap"),
        (["a.mcap"] * 5, "5 logs"),
        (["a.mcap", "--out", "."], "it is a directory"),
        (["--out", "file/thesis.html"], "cannot write file/thesis.html"),
    ],
)
def test_wrong_input_is_refused_before_anything_is_computed(
    arguments: list[str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("file").write_text("")
    assert main(["report", *arguments]) == 2
    assert expected in capsys.readouterr().err
