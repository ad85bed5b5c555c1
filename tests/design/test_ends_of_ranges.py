"""Both ends of every number of `design`: a design has the properties that it reports, or is refused.

The oracles are independent of what they judge:

- pole placement: the coefficients of the polynomial with these roots, in exact arithmetic;
- lqr: the spectral factorisation p(s) p(-s), its residual in exact arithmetic, and SciPy's Riccati solver;
- S/KS and loop shaping: the norm of the closed loop by a sweep over 23 decades of frequency; the smallest
  gamma is at most that, and at least what no controller can pass: |W_s| at infinite frequency, or 1;
- margins and peaks: the same sweep, and the inequalities between disk, gain and phase margins;
- stability: eigenvalues of the assembled closed loop, continuous and sampled;
- the controller as a whole: a short run on the nonlinear crane.
"""

import json
import re
from fractions import Fraction

import control
import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from cranectl.cli.main import main
from cranectl.design import CONTROLLERS, Design
from cranectl.design.linear_systems import closed_loop_poles, loop_margins
from cranectl.design.records import CHAIN_A, CHAIN_B
from cranectl.planning import load_scenario
from cranectl.scenario import DesignSettings
from cranectl.simulate import simulate_run
from cranectl.status import RunStatus
from tests.loops import chain_loop, check_margins, modal_response, spectral_residual, swept_peak
from tests.ranges import ALL, changes, has_found_allowed_and_remedy, share_of
from tests.reference.recordings import inline

SHARE = 8
SAMPLES = 200 if ALL else 0
DEFAULTS = DesignSettings().model_dump(mode="json")
USED = {  # parts of a controller's name, and the first keys that its design depends on
    "pole-placement": ("poles",),
    "lqr": ("state_weights", "input_weight"),
    "hinf": ("hinf",),
    "loop-shaping": ("loop_shaping",),
}
SHORT = ["duration=0.2", "disturbances.0.start=0.02", "disturbances.1.start=0.05"]
# Margins, gains and norms that were wrong, and a solver that ended in a traceback.
FOUND = (
    ("lqr: decades", "lqr", {"state_weights": [2e-4, 8e-9, 1e9, 1.4e-3], "input_weight": 1.76e6}),
    ("lqr: k0", "lqr", {"state_weights": [1e-9, 1e9, 1e-9, 1e-9], "input_weight": 1e-9}),
    ("lqr: bandwidth", "lqr", {"state_weights": [1e9, 1e9, 1e9, 1e9], "input_weight": 1e-9}),
    ("hinf: margins", "lqr+hinf", {"hinf": {"control_weight": 3.6e-9, "offset": 7e-6, "back_off": 3.4}}),
    ("hinf: fast pole", "lqr+hinf", {"hinf": {"back_off": 1.0}}),
    ("hinf: norm", "pole-placement+hinf", {"poles": [-0.03] * 4}),
    ("shaping: seen", "lqr+loop-shaping", {"loop_shaping": {"proportional": 1e-6, "integral": 1e-6}}),
    ("shaping: disk", "pole-placement+loop-shaping", {"poles": [-1000.0, -0.001, -0.00125, -0.0052]}),
)
Case = tuple[str, str, dict]


def of_ends() -> list[Case]:
    all_cases = []
    for change, table in changes(DesignSettings, DEFAULTS, last=3):
        setting = re.split("[.=]", change)[0]
        names = [name for name in CONTROLLERS if any(setting in USED[part] for part in name.split("+"))]
        all_cases += [(f"{name}: {change}", name, {setting: table[setting]}) for name in names]
    for end in (-1e-3, -1e3):
        all_cases += [(f"{name}: poles={end}", name, {"poles": [end] * 4}) for name in CONTROLLERS[:3]]
    return list({case[0]: case for case in all_cases}.values())


def of_samples() -> list[Case]:
    """Return cases in which many numbers change together, a third of them to an end of their range."""
    rng, all_cases = np.random.default_rng(2), []

    def number(low: float, high: float) -> float:
        if rng.random() < 0.3:
            return float(rng.choice([low, high]))
        return float(np.clip(np.exp(rng.uniform(np.log(low), np.log(high))), low, high))

    for k in range(SAMPLES):
        name = CONTROLLERS[k % len(CONTROLLERS)]
        bounds = {"peak": (1.0000001, 1e3), "offset": (1e-6, 1.0), "bandwidth": (1e-3, 1e3)}
        bounds |= {"control_weight": (1e-9, 1e3), "back_off": (1.0, 10.0)}
        whole = {
            "poles": [-number(1e-3, 1e3) for _ in range(4)],
            "state_weights": [number(1e-9, 1e9) for _ in range(4)],
            "input_weight": number(1e-9, 1e9),
            "hinf": {key: number(*ends) for key, ends in bounds.items() if rng.random() < 0.4},
            "loop_shaping": {
                "proportional": number(1e-6, 1e6),
                "integral": number(1e-6, 1e6),
                "back_off": number(1.0001, 10.0),
            },
        }
        kept = {key for part in name.split("+") for key in USED[part]}
        all_cases.append((f"sample {k}: {name}", name, {key: whole[key] for key in whole if key in kept}))
    return all_cases


ENDS = of_ends()
SHIPPED = [pytest.param((f"defaults: {name}", name, {}), marks=pytest.mark.processor) for name in CONTROLLERS]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "case",
    [*SHIPPED, *FOUND, *share_of(ENDS, SHARE), *of_samples()],
    ids=lambda case: case[0].replace("/", " "),
)
def test_a_design_has_the_properties_that_it_reports_or_is_refused(
    case: Case, capsys: pytest.CaptureFixture[str]
) -> None:
    _, name, table = case
    changes = [f"design.{key}={inline(value)}" for key, value in table.items()]
    options = [word for change in changes for word in ("--set", change)]
    code = main(["design", name, "--scenario", "fixed-position", *options, "--json", "-"])
    printed = capsys.readouterr()
    if code == 2:
        assert has_found_allowed_and_remedy(printed.err), printed.err
        return
    assert code == 0, printed.err
    design = Design.from_json(json.loads(printed.out))
    scenario = load_scenario("fixed-position", overrides=[*SHORT, *changes])
    settings = scenario.design
    check_gain(design, settings)
    assert closed_loop_poles(design.open_loop()).real.max() < 0.0
    assert design.closed_loop_poles.real.max() < 0.0
    check_margins(design.margins, chain_loop(design.gain, design.robustifier))
    if design.gamma is not None:
        check_norm(design, settings)
    run = simulate_run(scenario, plant="analytic", controller=name)
    assert run.status in (RunStatus.COMPLETED, RunStatus.SLACK_ROPE)  # which strong feedback may ask for
    assert np.isfinite(run.table).all()


def check_gain(design: Design, settings: DesignSettings) -> None:
    if design.name.startswith("pole-placement"):
        wanted = [Fraction(1)]
        for pole in map(Fraction, map(float, settings.poles)):
            wanted = [
                a - pole * b for a, b in zip([*wanted, Fraction(0)], [Fraction(0), *wanted], strict=True)
            ]
        assert design.gain[::-1] == pytest.approx([float(gain) for gain in wanted[1:]], rel=1e-9, abs=0.0)
        return
    relative = np.array(settings.state_weights) / settings.input_weight
    assert spectral_residual(design.gain, relative) < 1e-6
    if relative.max() < 1e6 * relative.min():
        cost = solve_continuous_are(CHAIN_A, CHAIN_B, np.diag(relative), [[1.0]])
        assert design.gain == pytest.approx((CHAIN_B.T @ cost)[0], rel=1e-5)


def check_norm(design: Design, settings: DesignSettings) -> None:
    """Return the norm of [W_s S; W_ks K S], or of the normalised coprime factors of the shaped loop."""
    hinf, shaping = settings.hinf, settings.loop_shaping

    def stacked(omega: np.ndarray) -> np.ndarray:
        s = 1j * omega
        plant = 1.0 / np.polyval(np.append(1.0, design.gain[::-1]), s)
        controller = modal_response(design.robustifier, omega)
        if design.stability_margin is None:
            weight = (s / hinf.peak + hinf.bandwidth) / (s + hinf.bandwidth * hinf.offset)
            both = np.hypot(np.abs(weight), hinf.control_weight * np.abs(controller))
        else:
            weight = shaping.proportional + shaping.integral / s
            both = np.hypot(1.0, np.abs(controller / weight)) * np.hypot(1.0, np.abs(plant * weight))
        return both / np.abs(1.0 + plant * controller)

    assert design.gamma is not None
    assert design.gamma_achieved == pytest.approx(swept_peak(stacked), rel=3e-4)
    assert design.gamma <= design.gamma_achieved
    if design.stability_margin is None:
        assert 1.0 / hinf.peak <= design.gamma <= 1.0 / hinf.offset * (1.0 + 1e-8)
        wanted = hinf.gamma or max(hinf.back_off, 1.0 + 2e-5) * design.gamma
    else:
        assert design.gamma >= 1.0
        assert design.stability_margin == pytest.approx(1.0 / design.gamma_achieved)
        wanted = shaping.back_off * design.gamma
    assert design.gamma_achieved <= wanted * (1.0 + 2e-4)


@pytest.mark.parametrize("pole", [1e-6, 1e-3, 1e9])
def test_a_bandwidth_is_found_at_any_speed(pole: float) -> None:
    """For a loop k / s, T = k / (s + k) is 3 dB below 1 at k."""
    loop = control.ss([[0.0]], [[pole]], [[1.0]], 0.0)
    assert loop_margins(loop).bandwidth == pytest.approx(pole * np.sqrt(10.0**0.3 - 1.0), rel=1e-6)


def test_every_number_of_a_design_is_tried_at_both_ends() -> None:
    keys = {label.partition(": ")[2].partition("=")[0] for label, *_ in ENDS}
    assert {"poles.0", "poles.3", "state_weights.3", "input_weight", "hinf.gamma"} <= keys
    assert {"loop_shaping.integral", "hinf.control_weight", "hinf.back_off"} <= keys
    assert len(ENDS) > 80
