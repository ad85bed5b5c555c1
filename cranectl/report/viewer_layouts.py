"""Layouts for viewers of logs, as the JSON that Foxglove and its open forks import.

Plots take their fields and units from the table of signals, topics from the log package.
"""

import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from cranectl.log import Topics
from cranectl.plants import PLANTS
from cranectl.report.viewer_panels import Layout, Panel, ViewerPanel, field_of, show_rig, without_legend
from cranectl.scenario import RigParameters
from cranectl.signals import Signal, SignalGroup
from cranectl.support import InputError, Palette

Lines = list[dict[str, Any]]  # of a plot
SIGNALS: dict[tuple[str, str], Signal] = {
    (group.name, signal.name): signal
    for group in SignalGroup.recorded(SignalGroup.of_flat_tracker(0))
    for signal in group.signals
}
DISTANCE = Topics.DISTANCE.signals[0]  # of the load
SIGNALS |= {(group, DISTANCE.name): DISTANCE for group in (Topics.DISTANCE.name, Topics.STEP)}
MIN_ORDER = -9.0  # power of ten of the least distance [m] that a fidelity level adds; less is rounding
DISTANCE_EXPONENT = -14.0  # power of ten of the least distance in logs
# Height of the standings in [%] of a window of 900 pixels.
TITLE, ROW_HEIGHT, MAX_STANDINGS_HEIGHT = 8.0, 8.0, 64.0
MAX_UNITS = 4  # of the signals that a controller logs
FOLLOWED = 30.0  # [s] that a live session's plots show


def layout_json(
    name: str,
    *,
    plants: Iterable[str] = (),
    labels: Sequence[str] = (),
    rig: RigParameters | None = None,
    logged: Sequence[Signal] | None = None,
    recorded: Collection[str] | None = None,
) -> str:
    """Return the layout `name` as a file's content, for a log of `plants`, by default the usual ones.

    `labels`: of the runs of an overlay or a ladder. The camera sees the whole `rig`.
    `logged`: what a controller outside the flat family logs under its own names. `recorded`: the signals of a
    log, as `/measured/state.alpha`; lines of others are left out. Raises InputError for an unknown name.
    """
    InputError.check_known("layout", [name], LAYOUTS)
    panels: dict[str, dict[str, Any]] = {}
    shown = labels if name in ("overlay", "ladder") else PLANTS.in_order(plants or PLANTS.by_default)
    drawn = _controller(shown, logged) if name == "controller" else LAYOUTS[name](shown)
    drawn = drawn if recorded is None else _with_signals(drawn, recorded) or drawn
    content: dict[str, Any] = {"layout": _numbered(drawn, panels), "configById": panels}
    content |= {"globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1.0}}
    for configuration in panels.values():
        show_rig(configuration, rig or RigParameters())
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _with_signals(layout: Layout, recorded: Collection[str]) -> Layout | None:
    """Return the layout with lines of `recorded` signals only, or None if nothing is left of it."""
    if isinstance(layout, dict):
        first, second = (_with_signals(layout[side], recorded) for side in ("first", "second"))
        return layout | {"first": first, "second": second} if first and second else first or second
    kind, configuration = layout
    if "paths" not in configuration:
        return layout
    signals = [".".join(path["value"].split(".")[:2]) for path in configuration["paths"]]  # topic and field
    paths = [path for path, name in zip(configuration["paths"], signals, strict=True) if name in recorded]
    return (kind, configuration | {"paths": paths}) if paths else None


def _numbered(layout: Layout, panels: dict[str, dict[str, Any]]) -> str | dict[str, Any]:
    """Return the layout with ids for panels, and put the panels into `panels`."""
    if isinstance(layout, dict):
        return layout | {side: _numbered(layout[side], panels) for side in ("first", "second")}
    kind, configuration = layout
    name = f"{kind}!{len(panels) + 1}"
    panels[name] = configuration
    return name


def _single(plants: Sequence[str]) -> Layout:
    """Return the layout of one run: the crane, the load, errors, angles, inputs, tension."""
    plant = PLANTS.reference(plants)
    load = [(_path(plant, "load", f"load_{axis}", k), _reference(axis)) for k, axis in enumerate("xyz")]
    plots = [
        ViewerPanel.plot("load", [line for pair in load for line in pair]),
        _axes_plot(plant, "error", "error", "tracking error"),
        _joint_plot(plant, "state", ("alpha", "beta"), "cardan angles"),
        _drive_plot(plant),
        ViewerPanel.plot("rope tension", [_path(plant, "load", "rope_tension")]),
    ]
    scene = ViewerPanel.scene(_cranes([plant]))
    left = ViewerPanel.column([scene, ViewerPanel.standings([plant]), ViewerPanel.events()], (62, 20, 18))
    return ViewerPanel.row([left, ViewerPanel.column(plots, (25, 19, 19, 19, 18))], (54, 46))


def _comparison(plants: Sequence[str]) -> Layout:
    """Return the layout of several plants: the crane and its ghosts, their signals and differences."""
    plants = plants if len(plants) > 1 else PLANTS.by_default
    left = _crane_and_standings(ViewerPanel.scene(_cranes(plants)), plants)
    return ViewerPanel.row(
        [left, _several(partial(_of_each, plants), ViewerPanel.row(_distance_plots(plants)))], (42, 58)
    )


def _controller(plants: Sequence[str], logged: Sequence[Signal] | None = None) -> Layout:
    """Return the layout of the controller: errors, commands, and the signals that it logs."""
    plant = PLANTS.reference(plants)
    if logged is None:
        inner = [
            _axes_plot(plant, "virtual_input", "virtual_input", "linear input v"),
            _axes_plot(plant, "virtual_input", "robustifier_output", "robustifier's part of v"),
            ViewerPanel.plot("dynamic extension", [_path(plant, "controller", "zeta")]),
            _axes_plot(plant, "flat_output", "load", "acceleration of the load", "_ddot"),
        ]
    else:
        inner = _controller_plots(plant, logged)
    plots = [
        _axes_plot(plant, "error", "error", "error e"),
        _axes_plot(plant, "error", "error", "its rate", "_dot"),
        *inner,
        _drive_plot(plant),
        _joint_plot(plant, "disturbance", ("alpha_disturbance", "beta_disturbance"), "disturbances"),
    ]
    left = _crane_and_standings(ViewerPanel.scene(_cranes([plant]), distance=6.2), [plant])
    half = len(plots) // 2
    right = ViewerPanel.column(
        [
            ViewerPanel.row([ViewerPanel.column(plots[:half]), ViewerPanel.column(plots[half:])]),
            ViewerPanel.events(),
        ],
        (85, 15),
    )
    return ViewerPanel.row([left, right], (34, 66))


def _controller_plots(plant: str, logged: Sequence[Signal]) -> list[Panel]:
    """Return plots of the signals that a controller logs, one for each of the first units."""
    topic, by_unit = Topics(plant).of("controller"), dict[str, list[dict[str, Any]]]()
    for signal in logged:
        lines = by_unit.setdefault(signal.unit, [])
        if len(lines) < len(Palette.VIEWER.series):
            colour = Palette.VIEWER.series[len(lines)]
            lines.append(_line(field_of(topic, signal.name), signal, signal.name, colour))
    return [ViewerPanel.plot("of the controller", lines) for lines in [*by_unit.values()][:MAX_UNITS]]


def _live(plants: Sequence[str]) -> Layout:
    """Return the layout of a live session: the cranes, the last half minute, and its controls."""
    plant = PLANTS.reference(plants)
    plots = [
        _axes_plot(plant, "error", "error", "tracking error"),
        _joint_plot(plant, "state", ("alpha", "beta"), "cardan angles"),
        _drive_plot(plant),
        *(_distance_plots(plants)[:1] if len(plants) > 1 else ()),
    ]
    for _, configuration in plots:
        configuration["followingViewWidth"] = FOLLOWED
    left = _crane_and_standings(ViewerPanel.scene(_cranes(plants)), plants)
    services = ViewerPanel.row([ViewerPanel.service("pulse"), ViewerPanel.service("reset")])
    pads = ViewerPanel.row([ViewerPanel.pad("drive x, y", "x", "y"), ViewerPanel.pad("drive x, z", "x", "z")])
    steering = ViewerPanel.column(
        [ViewerPanel.of("Parameters", "steering"), pads, services, ViewerPanel.events()], (44, 20, 18, 18)
    )
    return ViewerPanel.row([left, ViewerPanel.column(plots), steering], (40, 31, 29))


def _overlay(labels: Sequence[str]) -> Layout:
    """Return the layout of runs by label: the crane of the first, the others as ghosts, their signals."""
    if not labels:
        raise InputError(
            "the layout overlay, of no runs",
            allowed="the runs of a log that cranectl log overlay or cranectl ladder wrote",
            remedy="name such a log with --log",
        )
    target = Topics(labels[0]).reference
    others = _of_labels(labels, Topics.DISTANCE.name, DISTANCE.name)
    far = (
        without_legend(ViewerPanel.plot(f"distance from {labels[0]}", others))
        if others
        else ViewerPanel.events()
    )
    shown = [Topics(label).of(kind) for label in labels for kind in ("model", "rope", "trail")]
    shown.append(Topics(labels[0]).arrows)
    left = _crane_and_standings(ViewerPanel.scene(shown), labels)
    return ViewerPanel.row([left, _several(partial(_of_labels, labels), far, target)], (42, 58))


def _ladder(labels: Sequence[str]) -> Layout:
    """Return the layout of a ladder: what each level adds, its distance from theory, the trails of all."""
    if len(labels) < 2:  # nothing to be compared
        return _overlay(labels)
    orders = []
    for where, group in (("the level before", Topics.STEP), (labels[0], Topics.DISTANCE.name)):
        lines = _of_labels(labels, group, DISTANCE.name, ".@log10")
        orders.append(ViewerPanel.plot(f"log₁₀ of distance from {where}", lines, minYValue=MIN_ORDER))
    metres = ViewerPanel.plot(
        f"distance from {labels[0]}", _of_labels(labels, Topics.DISTANCE.name, DISTANCE.name)
    )
    shown = [*(Topics(labels[0]).of(kind) for kind in ("model", "rope")), Topics(labels[0]).arrows]
    shown += [Topics(label).of("trail") for label in labels]
    left = _crane_and_standings(ViewerPanel.scene(shown), labels[-1:])
    others = map(without_legend, (orders[1], metres))
    right = ViewerPanel.column([orders[0], *others, ViewerPanel.events()], (44, 20, 20, 16))
    return ViewerPanel.row([left, right], (42, 58))


LAYOUTS: Mapping[str, Callable[[Sequence[str]], Layout]] = {
    "single": _single,
    "comparison": _comparison,
    "controller": _controller,
    "live": _live,
    "overlay": _overlay,
    "ladder": _ladder,
}


def _several(of: Callable[[str, str], Lines], distances: Layout, topic: str = Topics.REFERENCE) -> Layout:
    """Show signals `of` several runs and the reference; the plot with the legend is as wide as two others."""
    x, *rest = (
        ViewerPanel.plot(f"load {a}", [*of("load", f"load_{a}"), _reference(a, topic)]) for a in "xyz"
    )
    angles = (ViewerPanel.plot(name, of("state", name)) for name in ("alpha", "beta"))
    y, z, alpha, beta = map(without_legend, (*rest, *angles))
    return ViewerPanel.column(
        [x, ViewerPanel.row([y, z]), ViewerPanel.row([alpha, beta]), distances, ViewerPanel.events()],
        (21, 21, 21, 21, 16),
    )


def _crane_and_standings(scene: Panel, names: Sequence[str]) -> Layout:
    """Return the crane above the table of runs, which is as high as its rows need."""
    panel = ViewerPanel.standings(names)
    share = min(TITLE + ROW_HEIGHT * len(panel[1]["paths"]), MAX_STANDINGS_HEIGHT)
    return ViewerPanel.column([scene, panel], (100.0 - share, share))


def _axes_plot(plant: str, group: str, stem: str, title: str, suffix: str = "") -> Panel:
    """Return a plot of the three axes of a quantity."""
    return _joint_plot(plant, group, [f"{stem}_{axis}{suffix}" for axis in "xyz"], title)


def _drive_plot(plant: str) -> Panel:
    names = [f"{drive}_acceleration" for drive in ("bridge", "trolley", "rope")]
    return _joint_plot(plant, "input", names, "commanded accelerations")


def _joint_plot(plant: str, group: str, names: Sequence[str], title: str) -> Panel:
    """Return a plot of some signals of one group."""
    return ViewerPanel.plot(title, [_path(plant, group, name, k) for k, name in enumerate(names)])


def _of_each(plants: Sequence[str], group: str, name: str) -> Lines:
    """Return a signal of each plant, MuJoCo's first: the first line of a plot lies on top."""
    return [
        {**_path(plant.name, group, name), "label": plant.label, "color": Palette.VIEWER[plant.colour]}
        for plant in (PLANTS[plant_name] for plant_name in reversed(plants))
    ]


def _of_labels(labels: Sequence[str], group: str, name: str, modifier: str = "") -> Lines:
    """Return a signal of each run of an overlay, in its colour; the first has no distance from itself."""
    first = 1 if name == DISTANCE.name else 0
    fields = (field_of(Topics(label).of(group), name) for label in labels)
    lines = zip(fields, labels, Palette.VIEWER.series, strict=False)
    return [_line(f"{field}{modifier}", SIGNALS[group, name], *look) for field, *look in lines][first:]


def _path(plant: str, group: str, name: str, k: int = 0) -> dict[str, Any]:
    """Return one line of a plot."""
    signal = SIGNALS[group, name]
    return _line(f"{Topics(plant).of(group)}.{name}", signal, signal.symbol, Palette.VIEWER.series[k])


def _distance_plots(plants: Sequence[str]) -> list[Panel]:
    """Return plots of the differences between plants, in powers of ten down to rounding."""
    several, others, plots = len(plants) > 2, [p for p in plants if p != PLANTS.reference(plants)], []
    for signal, colour in zip(Topics.DISTANCE.signals, Palette.VIEWER.series, strict=False):
        lines = []
        for name in others:
            topic = Topics.difference(Topics.DISTANCE.name, name if several else "")
            look = signal.symbol, colour
            if several:
                look = PLANTS[name].label, Palette.VIEWER[PLANTS[name].colour]
            lines.append(_line(f"{topic}.{signal.name}.@log10", signal, *look))
        plots.append(ViewerPanel.plot(f"log₁₀ {signal.symbol}", lines, minYValue=DISTANCE_EXPONENT))
    return plots


def _reference(axis: str, topic: str = Topics.REFERENCE) -> dict[str, Any]:
    (signal,) = (signal for signal in SignalGroup.REFERENCE.signals if signal.name == f"load_{axis}")
    return _line(field_of(topic, signal.name), signal, signal.symbol, Palette.VIEWER["reference"])


def _line(value: str, signal: Signal, label: str, colour: str) -> dict[str, Any]:
    shown = {"value": value, "label": label, "color": colour, "unit": signal.unit}
    return {**shown, "enabled": True, "timestampMethod": "receiveTime"}


def _cranes(plants: Sequence[str]) -> list[str]:
    """Return the topics that draw these plants."""
    return [topic for plant in plants for topic in Topics(plant).drawn]
