"""Where the segments of a reference are from, for people."""

from cranectl.reference.planning.review import reviews
from cranectl.scenario import Scenario
from cranectl.scenario.segments import Spline
from cranectl.support.units import quantity

DIGITS = 12  # of a digest


def origins(scenario: Scenario) -> dict[str, str]:
    """By name, `segment 0`, what a segment from a file is made of, and what a planned one is worth."""
    segments = enumerate(scenario.reference.segments)
    made = {k: _origin(each) for k, each in segments if isinstance(each, Spline) and each.source}
    for review in reviews(scenario):
        made[review.segment] = "; ".join([*filter(None, [made.get(review.segment)]), review.in_short])
    return {f"segment {k}": made[k] for k in sorted(made)}


def _origin(spline: Spline) -> str:
    source, fit = spline.source, spline.fit
    assert source is not None
    held = "held here" if spline.held else "not held here"
    file = f"{spline.made_from.get('kind')} from {source.file} (SHA-256 {source.sha256[:DIGITS]}, {held})"
    if fit is None:
        return f"{file}: {len(spline.breaks)} points"
    left_out, residual = (quantity(error, "m") for error in (fit.left_out_error, fit.residual))
    return (
        f"{file}: {fit.samples} samples, {fit.spans} spans; samples left out are {left_out} rms from it, all "
        f"others {residual}; z'''' up to {fit.peak_d4:.3g} ± {fit.band_d4:.2g} m/s⁴"
    )
