"""Draw the figures of explanations, and of the thesis's page, into docs/pictures/.

python docs/figures.py            draw all of them
python docs/figures.py DIRECTORY  draw them into another folder
"""

import json
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cranectl.model.flatness import states_and_inputs
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run

IDENTIFICATION = Path(__file__).resolve().parents[1] / "validation" / "proofs" / "identification.json"
THESIS = Path(__file__).resolve().parents[1] / "validation" / "thesis" / "printed.toml"
PICTURES = Path(__file__).resolve().parent / "pictures"
COLOURS = ("#1f6fb4", "#d9601a", "#2f8f4e", "#8a4fa3")
GREY = "#666666"


def run_of(controller: str, *overrides: str, drive: str = "velocity") -> Run:
    """Return a run of `fast-diagonal` without its disturbance."""
    scenario = load_scenario("fast-diagonal", overrides=["disturbances=[]", *overrides])
    return simulate_run(scenario, plant="elastic", controller=controller, drive=drive)


def error_of(run: Run) -> np.ndarray:
    """Return the distance of the load from its reference at each sample [mm]."""
    return 1e3 * np.linalg.norm(run.block("load")[:, :3] - run.reference[:, :3], axis=1)


def canvas(height: float, *shape: int, **more: Any) -> tuple[Figure, Any]:
    """Return a figure of this height [in] and its axes."""
    figure = Figure(figsize=(9.0, height), layout="constrained")
    return figure, figure.subplots(*shape, **more)


def finish_axes(axes: Axes, title: str, x: str, y: str, legend: bool = True) -> None:
    """Set title and labels of a plot."""
    axes.set_title(title, loc="left", fontsize=10)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    if legend:
        axes.legend(frameon=False, fontsize=9)


def flatness() -> Figure:
    """Draw a load that is carried along a line, and the crane that this path requires."""
    settings = ["disturbances=[]", "duration=4", "reference.start=[0.3,0.77,-0.9]"]
    line = "reference.segments=[{kind='line', to=[1.6,0.77,-0.9], duration=2.2}]"
    scenario = load_scenario("fast-diagonal", overrides=[*settings, line])
    run = simulate_run(scenario, plant="analytic", controller="lqr", drive="ideal")
    flat = run.reference
    states, _ = states_and_inputs(flat, scenario.rig.gravity)
    figure, (side, time) = canvas(3.6, 1, 2, width_ratios=(1.35, 1.0))
    for k in np.searchsorted(run.time, np.linspace(0.25, 1.95, 12)):
        side.plot([states[k, 0], flat[k, 0]], [0.0, flat[k, 2]], color=GREY, lw=1)
        side.plot(states[k, 0], 0.0, "s", color=COLOURS[1], ms=8)
        side.plot(flat[k, 0], flat[k, 2], "o", color=COLOURS[0], ms=9)
    side.plot([], [], "s", color=COLOURS[1], label="trolley: follows from the path")
    side.plot([], [], "o", color=COLOURS[0], label="load: you choose its path")
    side.set_aspect("equal")
    side.set_ylim(-1.05, 0.42)
    finish_axes(side, "The crane at equal steps of time", "x [m]", "z [m]")
    ends = run.time <= 2.6
    time.plot(run.time[ends], flat[ends, 0], color=COLOURS[0], label="load")
    time.plot(run.time[ends], states[ends, 0], color=COLOURS[1], label="trolley")
    time.annotate("leads to accelerate", (0.8, 0.66), (0.0, 1.15), arrowprops={"arrowstyle": "-"}, fontsize=9)
    time.annotate("lags to brake", (1.45, 1.2), (1.55, 0.75), arrowprops={"arrowstyle": "-"}, fontsize=9)
    finish_axes(time, "Both over time", "time [s]", "x [m]")
    return figure


def drives() -> Figure:
    """Draw the error that real drives cause, with and without what a controller does about it."""
    figure, axes = canvas(3.0)
    runs = {
        "ideal drives": run_of("lqr", drive="ideal"),
        "velocity drives, lag compensated": run_of("lqr"),
        "velocity drives, lag ignored": run_of("lqr", "control.lag_compensation=false"),
    }
    for colour, (label, run) in zip(COLOURS, runs.items(), strict=False):
        axes.plot(run.time, error_of(run), color=colour, label=label)
    finish_axes(axes, "The load of a fast move, with a lag of 20 ms", "time [s]", "distance from path [mm]")
    return figure


def delays() -> Figure:
    """Draw how a delay takes away damping until the loop is unstable."""
    figure, axes = canvas(3.0)
    for colour, delay in zip(COLOURS, (0.0, 0.05, 0.1, 0.14), strict=True):
        run = run_of("lqr", f"effects.delay.seconds={delay}", "duration=8")
        axes.plot(run.time, error_of(run), color=colour, label=f"{1e3 * delay:.0f} ms")
    finish_axes(axes, "The same move with a delay in the loop", "time [s]", "distance from path [mm]")
    return figure


def observers() -> Figure:
    """Draw the rate of an angle: by differences of the encoder, by the observer, and as it is."""
    run = run_of("lqr", "effects.sensing={}")
    shown = (run.time >= 1.0) & (run.time <= 1.3)
    resolution = run.scenario.rig.effects.sensing.angle_resolution
    time, encoder = run.time[shown], resolution * np.round(run.signal("state.beta")[shown] / resolution)
    figure, axes = canvas(3.0)
    differences = np.diff(encoder) / np.diff(time)
    axes.plot(time[1:], differences, color=GREY, lw=0.6, label="differences of the encoder")
    axes.plot(time, run.signal("measurement.beta_rate")[shown], color=COLOURS[1], label="observer")
    axes.plot(time, run.signal("state.beta_rate")[shown], color=COLOURS[0], ls="--", label="true")
    finish_axes(axes, "The rate of an angle, from encoders", "time [s]", "rate of β [rad/s]", legend=False)
    axes.legend(loc="upper left", framealpha=1.0, fontsize=9)
    return figure


def verdicts() -> Figure:
    """Draw the statistic of the verdicts on unchanged and on changed cranes, from the proof's results."""
    exact = json.loads(IDENTIFICATION.read_text(encoding="utf-8"))["parts"]["exact"]
    rows = [row for facts in exact.values() for row in facts["rows"]]
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    figure, axes = canvas(3.6)
    for answer, colour, marker in (("covered", COLOURS[2], "o"), ("not covered", COLOURS[1], "x")):
        shown = [(row["T"], kinds.index(row["kind"])) for row in rows if row["answer"] == answer]
        axes.plot(*zip(*shown, strict=True), marker, color=colour, ls="", ms=5, alpha=0.7, label=answer)
    axes.set_xscale("log")
    axes.set_yticks(range(len(kinds)), kinds)
    axes.invert_yaxis()
    finish_axes(axes, "New runs of 12 hidden cranes", "largest difference, in standard deviations", "")
    return figure


def thesis() -> Figure:
    """Draw how far two disturbances push the held load: over time, and at the end as printed in Table 5.2."""
    printed = tomllib.loads(THESIS.read_text(encoding="utf-8"))
    norms = {entry["controller"]: entry["gamma"] for entry in printed["norms"]}
    rows = printed["tables"]["5.2"]["rows"]
    figure, (time, end) = canvas(3.4, 1, 2, width_ratios=(1.35, 1.0))
    for place, (controller, position) in enumerate(rows.items()):
        overrides = [f"design.hinf.gamma={norms[controller]}"] if controller.endswith("+hinf") else []
        scenario = load_scenario("fixed-position", overrides=overrides)
        run = simulate_run(scenario, plant="analytic", controller=controller, drive="ideal")
        error, target = error_of(run), run.reference[-1, :3]
        colour, dashed = COLOURS[place % 3], controller.startswith("lqr")
        time.plot(run.time, error, color=colour, ls="--" if dashed else "-", label=controller)
        end.plot(error[-1], place, "o", color=colour, ms=4)
        end.plot(1e3 * np.linalg.norm(position - target), place, "o", color=GREY, mfc="none", ms=9)
    finish_axes(time, "Under two disturbances (dashed: LQR)", "time [s]", "load off its place [mm]", False)
    end.set_yticks(range(len(rows)), rows)
    for place, label in enumerate(end.get_yticklabels()):
        label.set_color(COLOURS[place % 3])
    end.invert_yaxis()
    finish_axes(end, "At the end: ring printed, dot run", "load off its place [mm]", "", legend=False)
    return figure


FIGURES = {draw.__name__: draw for draw in (flatness, drives, delays, observers, verdicts, thesis)}


def main(directory: Path) -> None:
    """Write every figure into a folder."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        draw().savefig(directory / f"{name}.png", dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURES)
