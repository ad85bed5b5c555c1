"""Where the segments of a reference are from, for people."""

from cranectl.scenario import Scenario
from cranectl.scenario.along_path import Plannable
from cranectl.scenario.segments import Segment, Spline
from cranectl.support.units import quantity

DIGEST_DIGITS = 12  # of a digest


def origins(scenario: Scenario) -> dict[str, str]:
    """Return by name, `segment 0`, what a segment from a file is made of, and what its plan claims."""
    made = {f"segment {k}": _origin(each) for k, each in enumerate(scenario.reference.segments)}
    return {name: origin for name, origin in made.items() if origin}


def _origin(segment: Segment) -> str:
    file = _file_of(segment) if isinstance(segment, Spline) and segment.source else ""
    claim = segment.claim if isinstance(segment, Plannable) else ""
    return "; ".join(filter(None, (file, claim)))


def _file_of(spline: Spline) -> str:
    source, fit = spline.source, spline.fit
    assert source is not None
    held = "held here" if spline.held else "not held here"
    file = (
        f"{spline.made_from.get('kind')} from {source.file} (SHA-256 {source.sha256[:DIGEST_DIGITS]}, {held})"
    )
    if fit is None:
        return f"{file}: {len(spline.breaks)} points"
    left_out, residual = (quantity(error, "m") for error in (fit.left_out_error, fit.residual))
    return (
        f"{file}: {fit.samples} samples, {fit.spans} spans; samples left out are {left_out} rms from it, all "
        f"others {residual}; z'''' up to {fit.peak_d4:.3g} ± {fit.band_d4:.2g} m/s⁴"
    )
