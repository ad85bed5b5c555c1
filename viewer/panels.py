"""Layouts taken apart: which panels there are, and one of them alone."""

import copy
import json
from pathlib import Path
from typing import Any

from cranectl.cli.main import main

Layout = dict[str, Any]


def shipped(name: str, directory: Path, *options: str) -> Layout:
    """A layout as users get it."""
    file = directory / f"{name}.json"
    assert main(["log", "layout", name, str(file), *options]) == 0
    layout: Layout = json.loads(file.read_text())
    return layout


def of_type(layout: Layout, kind: str) -> dict[str, dict[str, Any]]:
    """Configurations of the panels of one type."""
    return {name: panel for name, panel in layout["configById"].items() if name.startswith(f"{kind}!")}


def alone(layout: Layout, name: str) -> Layout:
    """One panel, filling the window."""
    return {**layout, "configById": {name: layout["configById"][name]}, "layout": name}


def with_values(layout: Layout) -> Layout:
    """Plots that also write down the value of every line: unlike its pixels it cannot hide behind another."""
    layout = copy.deepcopy(layout)
    for plot in of_type(layout, "Plot").values():
        plot.update(showLegend=True, showPlotValuesInLegend=True, legendDisplay="floating")
    return layout
