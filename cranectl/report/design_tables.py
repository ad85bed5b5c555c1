"""What a design achieves, for the terminal."""

import math
from itertools import zip_longest

import numpy as np

from cranectl.design import Design
from cranectl.report.table import Table, cells


def design_tables(design: Design) -> tuple[Table, Table]:
    """Figures of a design, and its poles."""
    margins = design.margins
    figures = (
        ("gain k0 … k3", "  ".join(f"{gain:.6g}" for gain in design.gain), "on e and three derivatives"),
        *_gamma_rows(design),
        ("gain margin", f"{margins.gain_margin:.3f}", "factor on the loop gain that destabilises"),
        ("phase margin", f"{math.degrees(margins.phase_margin):.1f}°", "at the crossover"),
        ("disk margin", f"{margins.disk_margin:.3f}", "balanced S - T: gain and phase together"),
        ("modulus margin", f"{margins.modulus_margin:.3f}", "distance of the loop from -1"),
        ("peak of S", f"{margins.sensitivity_peak:.3f}", ""),
        ("peak of T", f"{margins.complementary_peak:.3f}", ""),
        ("crossover", f"{margins.crossover:.2f} rad/s", "loop gain 1"),
        ("bandwidth", f"{margins.bandwidth:.2f} rad/s", "T 3 dB below 1"),
    )
    closed_loop, robustifier = (
        [_pole_text(pole) for pole in sorted(poles.tolist(), key=lambda pole: (-pole.real, pole.imag))]
        for poles in (design.closed_loop_poles, np.linalg.eigvals(design.robustifier.a))
    )
    poles = zip_longest(closed_loop, robustifier, fillvalue="")
    return (
        Table(f"{design.name}, one axis", ("", "", ""), tuple(cells(*row) for row in figures), labels=3),
        Table("Poles [1/s]", ("closed loop", "robustifier"), tuple(cells(*row) for row in poles), labels=2),
    )


def _gamma_rows(design: Design) -> list[tuple[str, str, str]]:
    if design.gamma is None or design.gamma_achieved is None:
        return []
    shaping = design.stability_margin is not None
    what = "coprime factors of the shaped loop" if shaping else "of [W_s S; W_ks K S]"
    rows = [("gamma", f"{design.gamma:.5f}", f"smallest possible, {what}")]
    rows.append(("gamma achieved", f"{design.gamma_achieved:.5f}", "by this robustifier"))
    if design.stability_margin is not None:
        rows.append(("stability margin", f"{design.stability_margin:.5f}", "1 / gamma achieved"))
    return rows


def _pole_text(pole: complex) -> str:
    return f"{pole.real:.4g}" + (f" {pole.imag:+.4g}i" if pole.imag else "")
