"""Panels of layouts for viewers, in the configuration that viewers read."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cranectl.log import Topics
from cranectl.plants import PLANTS
from cranectl.scenario import Drawing, RigParameters

Panel = tuple[str, dict[str, Any]]  # its kind and configuration
Layout = Panel | dict[str, Any]  # a panel, or two layouts side by side

BUTTON_SPEED = 0.4  # share of the speed limits that a button commands; up to half is allowed
CAMERA = {  # looks at the middle of the rig from outside a long side, past the posts
    "perspective": True, "phi": 68.0, "thetaOffset": 18.0, "fovy": 40.0, "near": 0.05, "far": 100.0,
    "target": [0.0, 0.0, 0.0], "targetOffset": [1.0, 0.77, -0.62], "targetOrientation": [0.0, 0.0, 0.0, 1.0],
}  # fmt: skip


class ViewerPanel:
    """Panels of layouts for viewers, by what they show."""

    @staticmethod
    def scene(drawn: Sequence[str], *, distance: float = 4.8) -> Panel:
        """Return a panel of what is `drawn` in space, seen from `distance` [m]."""
        shown = [Topics.PATH, Topics.WORKSPACE, *drawn]
        grid = {
            "layerId": "foxglove.Grid", "instanceId": "floor", "label": "floor", "visible": True,
            "frameId": "world", "size": 4.0, "divisions": 16, "lineWidth": 1, "color": "#8f99a5a0",
            "position": [1.0, 0.77, -1.4], "rotation": [0.0, 0.0, 0.0], "order": 1,
        }  # fmt: skip
        return ViewerPanel.of(
            "3D",
            "crane",
            cameraState={**CAMERA, "distance": distance},
            followMode="follow-none",
            followTf="world",
            # Without axes of the frames, which would cover the crane.
            scene={"transforms": {"showLabel": False, "axisScale": 0.0, "lineWidth": 0.0}},
            transforms={},
            topics={topic: {"visible": True} for topic in shown},
            layers={"floor": grid},
            publish={"type": "point"},
            imageMode={},
        )

    @staticmethod
    def plot(title: str, paths: Sequence[dict[str, Any]], **limits: float) -> Panel:
        """Return a plot over time, with the unit in its title, since viewers have no place for it."""
        (unit,) = {path["unit"] for path in paths}
        lines = [{key: value for key, value in path.items() if key != "unit"} for path in paths]
        return ViewerPanel.of(
            "Plot",
            f"{title} [{unit or 1}]",
            paths=lines,
            showXAxisLabels=True,
            showYAxisLabels=True,
            showLegend=len(paths) > 1,
            legendDisplay="left",
            showPlotValuesInLegend=False,
            isSynced=True,
            xAxisVal="timestamp",
            sidebarDimension=round(38 + 6.5 * max(4, *(len(path["label"]) for path in paths))),
            **limits,
        )

    @staticmethod
    def events() -> Panel:
        """Return the panel of events in words."""
        return ViewerPanel.of("RosOut", "events", searchTerms=[], minLogLevel=1, topicToRender=Topics.LOG)

    @staticmethod
    def service(name: str) -> Panel:
        """Return a button of a live session."""
        shown = {"buttonText": name, "layout": "vertical", "editingMode": False, "timeoutSeconds": 10}
        return ViewerPanel.of("CallService", name, serviceName=f"/{name}", requestPayload="{}", **shown)

    @staticmethod
    def pad(title: str, horizontal: str, vertical: str) -> Panel:
        """Return four buttons that drive by hand, here in shares of the drives' speed; see `show_rig`."""
        commands = {}
        for axis, names in ((horizontal, ("right", "left")), (vertical, ("up", "down"))):
            for name, sign in zip(names, (1, -1), strict=True):
                commands[f"{name}Button"] = {"field": f"linear-{axis}", "value": BUTTON_SPEED * sign}
        return ViewerPanel.of("Teleop", title, topic="/wish", publishRate=10, **commands)

    @staticmethod
    def standings(plants: Sequence[str]) -> Panel:
        """Show the status of each run, and what the reference of all does where there are few."""
        shown = [(plant, "status") for plant in plants] + [(plants[-1], "phase")] * (len(plants) < 3)
        paths = []
        for plant, field in shown:
            value = field_of(Topics(plant).status, field)
            name = PLANTS[plant].label if plant in PLANTS else plant  # the crane of a ladder has no label
            paths.append({"value": value, "label": f"{name} {field}", "timestampMethod": "receiveTime"})
        return ViewerPanel.of("StateTransitions", "phase and status", paths=paths, isSynced=True)

    @staticmethod
    def row(parts: Sequence[Layout], shares: Sequence[float] = ()) -> Layout:
        """Return parts side by side with these shares, by default equal ones."""
        return _split("row", parts, shares)

    @staticmethod
    def column(parts: Sequence[Layout], shares: Sequence[float] = ()) -> Layout:
        """Return parts one below the other with these shares, by default equal ones."""
        return _split("column", parts, shares)

    @staticmethod
    def of(kind: str, title: str, **configuration: Any) -> Panel:
        """Return a panel; both open viewers have their own key for the title."""
        return kind, {**configuration, "foxglovePanelTitle": title, "lichtblickPanelTitle": title}


def show_rig(configuration: dict[str, Any], rig: RigParameters) -> None:
    """Fit camera, floor, ranges of plots and the speeds of buttons to a rig."""
    if "paths" in configuration:
        configuration.update(plot_range(configuration["paths"], rig))
    for button in ("upButton", "downButton", "leftButton", "rightButton"):
        if button in configuration:
            command = configuration[button]
            most = rig.effects.limits.velocity["xyz".index(command["field"][-1])]
            command["value"] = round(command["value"] * most, 4)
    drawing = Drawing(rig)
    if "cameraState" not in configuration or drawing.is_as_filed:
        return
    camera, floor = configuration["cameraState"], configuration["layers"]["floor"]
    across, down = np.radians((camera["thetaOffset"], camera["phi"]))
    c, s = np.cos((across, down)), np.sin((across, down))
    right, up, back = (c[0], -s[0], 0.0), (s[0] * c[1], c[0] * c[1], s[1]), (-s[0] * s[1], -c[0] * s[1], c[1])
    axes, tangent = np.array([right, up, back]), np.tan(np.radians(camera["fovy"] / 2.0))
    target, distance = np.array(camera["targetOffset"]), camera["distance"]
    eye, farther = drawing.eye(target + distance * axes[2], axes, np.full(2, tangent))
    camera["distance"] = round(farther * distance, 3)
    camera["targetOffset"] = (eye - farther * distance * axes[2]).round(3).tolist()
    camera["near"], camera["far"] = (round(drawing.reach * camera[key], 4) for key in ("near", "far"))
    low, high = drawing.box
    floor["size"] = round(drawing.reach * floor["size"], 3)
    floor["position"] = [*((low + high)[:2] / 2.0).round(3).tolist(), -rig.rope_range[1]]


def plot_range(paths: Sequence[dict[str, Any]], rig: RigParameters) -> dict[str, float]:
    """Return the ends of the vertical axis of a plot of load positions or of rope tension.

    A viewer would enlarge a constant until only rounding is seen. A load may swing beyond the end of a rail.
    """
    (x, y), lowest = (rig.bridge_range, rig.trolley_range), -rig.rope_range[1]
    travels = {"load_x": x, "load_y": y, "load_z": (lowest, 0.0)}
    fields = [path["value"].rpartition(".")[2] for path in paths]
    if set(fields) == {"rope_tension"}:
        return {"minYValue": 0.0, "maxYValue": round(2.0 * rig.weight, 2)}
    if not set(fields) <= travels.keys():
        return {}
    ends = np.array([travels[field] for field in fields])
    (low, high), beyond = (ends.min(), ends.max()), 0.1 * np.ptp(ends, axis=1).max()
    return {"minYValue": round(low - beyond, 2), "maxYValue": round(high + beyond, 2)}


def field_of(topic: str, name: str) -> str:
    """Return a field as viewers name it; topics with other signs than letters are in quotes."""
    return f'"{topic}".{name}' if "+" in topic else f"{topic}.{name}"


def without_legend(drawn: Panel) -> Panel:
    """Return a plot without its legend, for lines that another plot explains."""
    kind, configuration = drawn
    return kind, {**configuration, "showLegend": False}


def _split(direction: str, parts: Sequence[Layout], shares: Sequence[float] = ()) -> Layout:
    """Return parts beside each other with these shares, by default equal ones, as nested pairs."""
    if len(parts) == 1:
        return parts[0]
    shares = shares or [1.0] * len(parts)
    return {
        "direction": direction,
        "first": parts[0],
        "second": _split(direction, parts[1:], shares[1:]),
        "splitPercentage": round(100.0 * shares[0] / sum(shares), 2),
    }
