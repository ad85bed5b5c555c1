"""Diagrams of the model, the controllers and the simulation, numbered as the thesis's lost figures.

Each is our own drawing of our own system: right signs, our symbols. `validation/diagrams/draw.py` draws them,
in the page's text colour; a page may set the CSS variables --block (fill of blocks, none by default) and
--forbidden (fill of the bounds in 4.6, as blocks by default).
"""

from typing import NamedTuple

from cranectl.support import resources


class Diagram(NamedTuple):
    """What stands beside a picture."""

    title: str
    note: str  # what it shows, and what the thesis prints wrongly


DIAGRAMS = {
    "2.1": Diagram(
        "Crane, world frame and cardan angles",
        "The frame lies at trolley height with z up: the load has z₃ < 0. α turns about +x and comes first, "
        "β turns about −y, in the plane that α has tilted.",
    ),
    "3.1": Diagram(
        "Tracking loop",
        "v = z_d⁗ + K e with e = z_d − z and its derivatives. v₃ passes two integrators, whose states ζ̇ and "
        "ζ = z̈₃ belong to the controller; with the measured state x they give the flat coordinates.",
    ),
    "4.2": Diagram(
        "Linearised system under state feedback",
        "One axis of three alike. The thesis has v = −K e here (4.9), with the opposite error sign to its "
        "own (3.47); with e = z_d − z it is v = z_d⁗ + K e.",
    ),
    "4.3": Diagram(
        "Linearised system with the additional input v̄",
        "v = z_d⁗ + K e + v̄, so v̄ acts on z through G(s) = 1/(s⁴ + k₃s³ + k₂s² + k₁s + k₀). The thesis's "
        "(4.17), v + K e = v̄, again has the opposite error sign.",
    ),
    "4.4": Diagram(
        "H∞ standard problem",
        "K(s) is to make the gain from w to z small: P₁₁ + P₁₂ K (I − P₂₂ K)⁻¹ P₂₁. The thesis prints "
        "(I − K P₂₂)⁻¹ in (4.20), whose sizes do not match, and loses the inverse in (4.21).",
    ),
    "4.5": Diagram(
        "S/KS mixed sensitivity in standard form",
        "e = w − G u; z₁ = W_s e weighs the error, z₂ = W_ks u the control effort. K is the robustifier. "
        "The thesis's (4.22) leaves out the row z₂ = W_ks u, without which nothing limits K.",
    ),
    "4.6": Diagram(
        "Loop-shaping specifications",
        "The smallest singular value of the shaped plant stays above the performance bound at low "
        "frequencies, the largest below the robustness bound at high ones. On the crane both are the same.",
    ),
    "4.7": Diagram(
        "Shaped plant",
        "G_s = W_a G W_e. The crane's designs take W_a = 1 and W_e = P + I/s.",
    ),
    "4.8": Diagram(
        "Shaped plant in the loop with K∞",
        "K∞ robustly stabilises the normalised coprime factors of G_s. It feeds back positively: no sign.",
    ),
    "4.9": Diagram(
        "Final controller",
        "The weights move from the plant to the controller, K = W_e K∞ W_a; the thesis prints W_a K∞ W_e, "
        "which closes another loop than the one that was shaped. As e = z_d − z, the robustifier is R = −K.",
    ),
    "5.1": Diagram(
        "Simulation",
        "Two plants that know nothing of each other, each in its own closed loop with the same control law, "
        "reference and disturbances. What they do is logged and compared.",
    ),
    "5.2": Diagram(
        "Nonlinear plant",
        "ẋ = f(x) + g(x) u, with the accelerations of bridge, trolley and rope as u. The disturbances d_α "
        "and d_β add to α̈ and β̈ only.",
    ),
    "5.3": Diagram(
        "Flat coordinates and tracking error",
        "Φ maps the state x with ζ and ζ̇ to the load's position and three derivatives; it is invertible "
        "while the rope is taut. The error is e = z_d − z.",
    ),
    "5.4": Diagram(
        "Linearising law with dynamic extension",
        "u = φ(x, ζ, ζ̇) + γ(x, ζ) v. The thesis writes φ(x) + γ(x) v, without the controller states ζ and ζ̇.",
    ),
    "5.5": Diagram(
        "Linearised crane with state feedback and input v̄",
        "Plant, flat coordinates and linearising law (5.2 to 5.4) together are three chains of four "
        "integrators. The thesis's caption has v + K e = v̄; with e = z_d − z it is v = z_d⁗ + K e + v̄.",
    ),
    "5.6": Diagram(
        "Linearised crane with robustifier",
        "The robustifier R(s), K(s) in the thesis, closes a second loop from e to v̄. It is designed as S/KS "
        "(4.5) or by loop shaping (4.9).",
    ),
}


def diagram_svg(number: str) -> str:
    """The diagram `number` as an <svg> element for a page."""
    return (resources.THESIS_DIRECTORY / "diagrams" / f"{number}.svg").read_text(encoding="utf-8").rstrip()
