"""Remedies that name the data of a design or of operating points work on the refused input."""

from tests.remedies import Case, remedy_test

PLACED = ["cranectl", "design", "pole-placement"]
REGULATED = ["cranectl", "design", "lqr"]
ROBUST = ["cranectl", "design", "pole-placement+hinf"]
SHAPED = ["cranectl", "design", "pole-placement+loop-shaping"]
FAST, SLOW = "design.poles=[-800, -800, -800, -800]", "design.poles=[-0.001, -0.001, -0.001, -0.001]"
EQUAL, APART = "design.poles=[-100, -100, -100, -100]", "design.poles=[-70, -85, -100, -120]"
SAMPLING = "design/discretisation.py"
SHORTER = "shorten control.period and with it control.physics_step, or {}"
STRONG, WEAK = "design.state_weights=[1e9, 1, 1, 1]", "design.input_weight=1e-9"
SHARP = "design.hinf.control_weight=1e-9"
FULL = [
    "design.loop_shaping.back_off=1.0001",
    "design.loop_shaping.proportional=1e6",
    "design.loop_shaping.integral=1e6",
]
LOOSER = "move design.poles towards 0, or raise design.input_weight or design.loop_shaping.integral"
STRONGEST = "design.state_weights=[1e9, 1e9, 1e9, 1e9]"
HIGH = "design.poles=[-20, -30, -40, -50]"
SLOWER = "design.poles=[-0.03, -0.03, -0.03, -0.03]"
GAMMA = "raise gamma, or leave it out and set back_off"
CONDITIONED = "design/linear_systems.py"
NEARER = "choose poles and weights that are nearer to their defaults"
FLAT = ["design.hinf.control_weight=1e-8", "design.hinf.bandwidth=0.001", "design.hinf.offset=1e-6"]
CERTIFY = ["cranectl", "certify", "pole-placement"]
POINTS = "analysis/certificate/operating_points.py"
LENGTHS = "choose other rope lengths, or set rig.rope_range"
CASES = [
    Case(
        SAMPLING,
        SHORTER,
        [*PLACED, FAST],
        [*PLACED, FAST, "control.period=1e-4", "control.physics_step=1e-4"],
    ),
    Case(
        "controllers/flat.py",
        "move design.poles towards 0",
        [*PLACED, FAST],
        [*PLACED, "design.poles=[-80, -80, -80, -80]"],
    ),
    Case(
        "controllers/flat.py",
        "raise design.input_weight",
        [*REGULATED, STRONG, WEAK],
        [*REGULATED, STRONG, "design.input_weight=0.01"],
    ),
    Case(
        "controllers/flat.py",
        "raise design.hinf.control_weight",
        [*ROBUST, SHARP],
        [*ROBUST, "design.hinf.control_weight=1e-7"],
    ),
    Case(
        "controllers/flat.py",
        "lower design.loop_shaping.proportional and integral",
        [*SHAPED, SLOW, *FULL],
        [*SHAPED, SLOW, "design.loop_shaping.proportional=1.0", "design.loop_shaping.integral=1.0"],
    ),
    Case(
        "design/hinf_synthesis.py",
        GAMMA,
        [*ROBUST, "design.hinf.gamma=0.1"],
        [*ROBUST, "design.hinf.gamma=0.5"],
    ),
    Case(
        "design/hinf_synthesis.py",
        GAMMA,
        [*ROBUST, "design.hinf.gamma=0.1"],
        [*ROBUST, "design.hinf.back_off=1.1"],
    ),
    Case(
        CONDITIONED,
        NEARER,
        [*ROBUST, SLOW],
        [*ROBUST, "design.poles=[-1, -1, -1, -1]"],
    ),
    Case(
        "design/linear_systems.py",
        "set design.poles that differ by a fifth or more, or change design.state_weights",
        [*ROBUST, EQUAL],
        [*ROBUST, APART],
    ),
    Case(CONDITIONED, NEARER, [*ROBUST, *FLAT], [*ROBUST, *FLAT, "design.hinf.control_weight=1e-7"]),
    Case(CONDITIONED, NEARER, [*ROBUST, *FLAT], [*ROBUST, *FLAT, "design.hinf.bandwidth=0.1"]),
    Case(
        "design/loop_shaping.py",
        LOOSER,
        [*SHAPED, "design.poles=[-1e3, -1e3, -1e3, -1e3]"],
        [*SHAPED, "design.poles=[-10, -10, -10, -10]"],
    ),
    Case(
        "design/loop_shaping.py",
        LOOSER,
        ["cranectl", "design", "lqr+loop-shaping", STRONGEST, WEAK],
        ["cranectl", "design", "lqr+loop-shaping", STRONGEST, "design.input_weight=1e6"],
    ),
    Case(
        "design/loop_shaping.py",
        LOOSER,
        [*SHAPED, HIGH, "design.loop_shaping.integral=1e-6"],
        [*SHAPED, HIGH],
    ),
    Case(
        CONDITIONED,
        NEARER,
        [*ROBUST, SLOWER],
        [*ROBUST, "design.poles=[-1, -1, -1, -1]"],
    ),
    Case(POINTS, LENGTHS, [*CERTIFY, "--rope-length", "9"], [*CERTIFY, "--rope-length", "1"]),
    Case(
        POINTS,
        LENGTHS,
        [*CERTIFY, "--rope-length", "9"],
        [*CERTIFY, "--rope-length", "9", "rig.rope_range=[0.05, 10.0]"],
    ),
    Case(
        POINTS,
        "choose a smaller tilt or a shorter rope",
        [*CERTIFY, "--rope-length", "1", "--tilt", "80", "0"],
        [*CERTIFY, "--rope-length", "1", "--tilt", "0.1", "0"],
    ),
]


test_a_remedy_works_on_the_refused_input = remedy_test(CASES, [])
