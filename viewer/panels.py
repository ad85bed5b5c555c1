"""Read and edit the layouts that cranectl ships for the viewer."""

import copy
import json
from pathlib import Path
from typing import Any

from cranectl.cli.main import main

Layout = dict[str, Any]


def load_shipped_layout(name: str, directory: Path, *options: str) -> Layout:
    """Return a layout that `cranectl log layout` writes."""
    file = directory / f"{name}.json"
    assert main(["log", "layout", name, str(file), *options]) == 0
    layout: Layout = json.loads(file.read_text())
    return layout


def panels_of_type(layout: Layout, kind: str) -> dict[str, dict[str, Any]]:
    """Return the configurations of all panels of one type, by panel id."""
    return {name: panel for name, panel in layout["configById"].items() if name.startswith(f"{kind}!")}


def single_panel(layout: Layout, name: str) -> Layout:
    """Return a layout in which one panel fills the window."""
    return {**layout, "configById": {name: layout["configById"][name]}, "layout": name}


def show_values(layout: Layout) -> Layout:
    """Return a layout whose plots have legends with values: one line can hide another, its value cannot."""
    layout = copy.deepcopy(layout)
    for plot in panels_of_type(layout, "Plot").values():
        plot.update(showLegend=True, showPlotValuesInLegend=True, legendDisplay="floating")
    return layout
