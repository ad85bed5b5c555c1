"""Check the errata of chapter 5: designs, tables, captions."""

import functools
import math
import tomllib

import numpy as np

from cranectl.design.loop_shaping import glover_mcfarlane
from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.support.resources import Shipped
from validation.thesis.errata.registry import erratum, excess_over, max_difference, shaped_plant

PRINTED = tomllib.loads((Shipped.THESIS_FOLDER / "printed.toml").read_text(encoding="utf-8"))["tables"]


@functools.cache
def analytic_run(scenario: str, controller: str) -> Run:
    """Simulate one of the thesis's cases on the analytic plant."""
    return simulate_run(load_scenario(scenario), plant="analytic", controller=controller)


@erratum("epsilon")
def norm_not_margin() -> tuple[float, float]:
    """Check epsilon: 2.4489 and 1.7600 are the norm 1/rho of (4.23); a margin would be below 1."""
    printed, right = [], []
    for feedback, value in (("pole-placement", 2.4489), ("lqr", 1.7600)):
        norm = glover_mcfarlane(shaped_plant(feedback)).gamma_min
        printed.append(abs(value - 1.0 / norm))
        right.append(excess_over(abs(value - norm), 1.5e-4))
    return min(printed), max(right)


@erratum("Table 5.1 (caption)")
def rope_column_is_a_minimum() -> tuple[float, float]:
    """Check Table 5.1: the rope's column has the signed minimum, not the maximum or the largest size."""
    printed, right = [], []
    for controller, (_, _, value) in PRINTED["5.1"]["rows"].items():
        metrics = run_metrics(analytic_run("fixed-position", controller))
        assert metrics is not None
        highest, lowest = metrics.max_acceleration_m_s2[2], metrics.min_acceleration_m_s2[2]
        printed.append(abs(highest - value))
        right.append(excess_over(abs(lowest - value), 0.006))
        if controller == "pole-placement+loop-shaping":
            assert highest > 1.2 * -lowest, (
                "the largest size is the positive one, which the table does not list"
            )
    return min(printed), max(right)


@erratum("after Table 5.2")
def which_row_is_best() -> tuple[float, float]:
    """Check the text after Table 5.2: it names LQR with H-infinity, but the table has loop shaping."""
    offset = {
        name: max_difference(values, (1.0, 0.77, -0.7)) for name, values in PRINTED["5.2"]["rows"].items()
    }
    return offset["lqr+hinf"], offset["lqr+loop-shaping"]


@erratum("5.2.2 (z_1 = 0.6)")
def end_of_the_line() -> tuple[float, float]:
    """Check z_1 = 0.6 by Table 5.3: a line to 0.6 and half a circle, or a line to 1.65 and a full circle."""
    arc = f"{{kind='arc', duration=10.0, centre=[1.125, 0.77], angle={math.pi!r}, time_law='degree-5'}}"
    line = "{kind='line', duration=10.0, to=[0.6, 0.77, -0.7], time_law='degree-5'}"
    scenario = load_scenario("settled-trajectory", overrides=[f"reference.segments=[{line}, {arc}]"])
    printed, right = [], []
    for controller in ("pole-placement", "lqr"):
        literal = simulate_run(scenario, plant="analytic", drive="ideal", controller=controller)
        chosen = analytic_run("settled-trajectory", controller)
        for run, errors in ((literal, printed), (chosen, right)):
            peaks = run.block("input")[run.time <= 20.0, :2].max(axis=0)
            errors.append(float(np.abs(peaks / PRINTED["5.3"]["rows"][controller][:2] - 1.0).max()))
    return min(printed), excess_over(max(right), 0.06)


@erratum("Table 5.3 (caption)")
def rope_column_mixes_extremes() -> tuple[float, float]:
    """Check Table 5.3: the column of l'' has the maximum in two rows and the minimum in four."""
    one_sided: dict[str, list[float]] = {"max": [], "min": [], "size": []}
    right = []
    for controller, (_, _, value) in PRINTED["5.3"]["rows"].items():
        run = analytic_run("settled-trajectory", controller)
        rope = run.block("input")[run.time <= 20.0, 2]
        one_sided["max"].append(abs(rope.max() - value))
        one_sided["min"].append(abs(rope.min() - value))
        one_sided["size"].append(abs(np.abs(rope).max() - abs(value)))
        extreme = rope.max() if value > 0 else rope.min()
        right.append(excess_over(abs(extreme - value), 0.07 * abs(value)))
    return min(max(errors) for errors in one_sided.values()), max(right)
