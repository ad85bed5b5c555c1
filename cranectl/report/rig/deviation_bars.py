"""Pairs of deviations of the load, a row a rung, on a logarithmic axis."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure as Drawing

from cranectl.report.theme import SERIES, STAND_IN, inline_svg, styled

WIDTH = 6.4  # [in]
LEAST = 1e-9  # [m] that is drawn


def deviation_bars(
    names: Sequence[str],
    pair: Mapping[str, Sequence[float]],
    anchor: str,
    *,
    bounds: Sequence[float] = (),
) -> str:
    """Two bars a name, from label to values [m], and a mark where a bound is finite; as SVG."""
    with styled():
        drawing = Drawing(figsize=(WIDTH, 0.9 + 0.3 * len(names)), layout="constrained")
        axes, place = drawing.subplots(), np.arange(len(names))
        for offset, role, (label, values) in zip((-0.2, 0.2), SERIES[:2], pair.items(), strict=True):
            lengths = np.maximum(values, LEAST)
            axes.barh(place + offset, lengths, height=0.36, color=STAND_IN[role], label=label)
        bounded = [(bound, k) for k, bound in enumerate(bounds) if 0.0 < bound < np.inf]
        if bounded:
            axes.plot(*zip(*bounded, strict=True), "|", color=STAND_IN["limit"], markersize=14, label="bound")
        axes.set_xscale("log")
        axes.set(xlim=(LEAST, None), xlabel="largest deviation of the load [m]")
        axes.set_yticks(place, names)
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        drawing.legend(loc="outside upper center", ncols=3)
        return inline_svg(drawing, anchor)
