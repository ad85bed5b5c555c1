"""What each figure shows, in a sentence with the figures of the runs in it."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from cranectl.metrics import RunMetrics, run_metrics, workspace_violations
from cranectl.report.run.figures import DEGREES, Family, largest_difference
from cranectl.signals import BRIDGE, TROLLEY
from cranectl.simulate import Run

Runs = Mapping[str, Run]  # by label


def caption(family: Family, runs: Runs) -> str:
    """What `family` shows of these runs, which share a scenario."""
    return _CAPTIONS[family.name](runs)


def agreement(family: Family, pairs: Sequence[tuple[Run, Run]], what: str) -> str:
    """How far the curves of the pairs are apart at most, after the phrase `what`."""
    largest = max(largest_difference(family, *pair) for pair in pairs)
    return f"{what} {_quantity(largest, family.unit)}"


def _trolley(runs: Runs) -> str:
    outside = [
        f"{label} drives the {left.signal.partition('_')[0]} {left.max_excess_m:.3f} m past the end "
        f"of the rig, from {left.first_time_s:.2f} s on"
        for label, run in runs.items()
        for left in workspace_violations(run)
    ]
    return f"{'; '.join(outside).capitalize()}." if outside else "All stay within the rig."


def _error(runs: Runs) -> str:
    end = next(iter(runs.values())).time[-1]
    errors = _each(runs, lambda run: _measured(run).final_error_m, "m")
    return f"Load off its reference at {end:g} s: {errors}."


def _input(runs: Runs) -> str:
    def peak(run: Run, axes: slice) -> float:
        return float(np.abs(_measured(run).peak_acceleration_m_s2)[axes].max())

    drives, rope = (_each(runs, partial(peak, axes=axes), "m/s²") for axes in (slice(2), slice(2, 3)))
    return f"Largest acceleration of bridge or trolley: {drives}; of the rope: {rope}."


def _angles(runs: Runs) -> str:
    largest = _each(runs, lambda run: max(_measured(run).max_abs_angle_rad) * DEGREES, "°")
    tilt = max(float(np.abs(run.angles[-1]).max() * DEGREES) for run in runs.values())
    return f"Largest angle: {largest}; at the end the rope leans by up to {_quantity(tilt, '°')}."


def _space(runs: Runs) -> str:
    return f"Farthest from the reference: {_each(runs, lambda run: _measured(run).max_error_m, 'm')}."


def _linear_input(runs: Runs) -> str:
    largest = _each(runs, lambda run: float(np.abs(run.block("virtual_input")[:, :3]).max()), "m/s⁴")
    return f"Largest |v|: {largest}."


def _relative(runs: Runs) -> str:
    def largest(run: Run) -> float:
        beside = run.block("load")[:, :2] - run.block("state")[:, [BRIDGE, TROLLEY]]
        return float(np.linalg.norm(beside, axis=1).max())

    return f"Farthest beside the trolley: {_each(runs, largest, 'm')}."


_CAPTIONS: dict[str, Callable[[Runs], str]] = {
    "space": _space,
    "error": _error,
    "linear-input": _linear_input,
    "input": _input,
    "trolley": _trolley,
    "angles": _angles,
    "load": _space,
    "trolley-path": _trolley,
    "load-path": _error,
    "relative-path": _relative,
}


def _measured(run: Run) -> RunMetrics:
    metrics = run_metrics(run)
    assert metrics is not None, "a figure has a sample at least"
    return metrics


def _each(runs: Runs, figure: Callable[[Run], float], unit: str) -> str:
    """The figure of every run, with labels where there are several."""
    if len(runs) == 1:
        return _quantity(figure(next(iter(runs.values()))), unit)
    return ", ".join(f"{_quantity(figure(run), unit)} ({label})" for label, run in runs.items())


def _quantity(value: float, unit: str) -> str:
    """Three digits, small numbers with powers of ten, kept on one line with their unit.

    A run that stopped may have done so because a number was none.
    """
    if not math.isfinite(value):
        number = f"{value}"
    elif value == 0.0 or value >= 1e-3:
        number = f"{value:#.3g}".rstrip(".")
    else:
        mantissa, _, exponent = f"{value:.1e}".partition("e")
        number = f"{mantissa} · 10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
    return f"{number}{'' if unit == '°' else ' '}{unit}".replace(" ", "\N{NO-BREAK SPACE}")


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
