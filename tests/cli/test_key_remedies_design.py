"""Remedies that name the data of a design or of operating points work on the refused input."""

from tests.remedies import Case, remedy_test

PLACED = "cranectl design pole-placement"
REGULATED = "cranectl design lqr"
ROBUST = "cranectl design pole-placement+hinf"
SHAPED = "cranectl design pole-placement+loop-shaping"
FAST, SLOW = "design.poles=[-800, -800, -800, -800]", "design.poles=[-0.001, -0.001, -0.001, -0.001]"
EQUAL, APART = "design.poles=[-100, -100, -100, -100]", "design.poles=[-70, -85, -100, -120]"
STRONG, WEAK = "design.state_weights=[1e9, 1, 1, 1]", "design.input_weight=1e-9"
FULL = [
    "design.loop_shaping.back_off=1.0001",
    "design.loop_shaping.proportional=1e6",
    "design.loop_shaping.integral=1e6",
]
LOOSER = "move design.poles towards 0, or raise design.input_weight or design.loop_shaping.integral"
STRONGEST = "design.state_weights=[1e9, 1e9, 1e9, 1e9]"
HIGH = "design.poles=[-20, -30, -40, -50]"
NEARER = "choose poles and weights that are nearer to their defaults"
FLAT = ["design.hinf.control_weight=1e-8", "design.hinf.bandwidth=0.001", "design.hinf.offset=1e-6"]
CERTIFY = "cranectl certify pole-placement --hoisting-speed 0"
CASES = {
    "design/discretisation.py": [
        Case("shorten control.period and with it control.physics_step, or {}", [PLACED, FAST],
             [PLACED, FAST, "control.period=1e-4", "control.physics_step=1e-4"]),
    ],
    "controllers/flat.py": [
        Case("move design.poles towards 0", [PLACED, FAST], [PLACED, "design.poles=[-80, -80, -80, -80]"]),
        Case("raise design.input_weight", [REGULATED, STRONG, WEAK],
             [REGULATED, STRONG, "design.input_weight=0.01"]),
        Case("raise design.hinf.control_weight", [ROBUST, "design.hinf.control_weight=1e-9"],
             [ROBUST, "design.hinf.control_weight=1e-7"]),
        Case("lower design.loop_shaping.proportional and integral", [SHAPED, SLOW, *FULL],
             [SHAPED, SLOW, "design.loop_shaping.proportional=1.0", "design.loop_shaping.integral=1.0"]),
    ],
    "design/hinf_synthesis.py": [
        Case("raise gamma, or leave it out and set back_off", [ROBUST, "design.hinf.gamma=0.1"],
             [ROBUST, "design.hinf.gamma=0.5"], [ROBUST, "design.hinf.back_off=1.1"]),
    ],
    "design/linear_systems.py": [
        Case(NEARER, [ROBUST, SLOW], [ROBUST, "design.poles=[-1, -1, -1, -1]"]),
        Case(NEARER, [ROBUST, *FLAT], [ROBUST, *FLAT, "design.hinf.control_weight=1e-7"],
             [ROBUST, *FLAT, "design.hinf.bandwidth=0.1"]),
        Case(NEARER, [ROBUST, "design.poles=[-0.03, -0.03, -0.03, -0.03]"],
             [ROBUST, "design.poles=[-1, -1, -1, -1]"]),
        Case("set design.poles that differ by a fifth or more, or change design.state_weights",
             [ROBUST, EQUAL], [ROBUST, APART]),
    ],
    "design/loop_shaping.py": [
        Case(LOOSER, [SHAPED, "design.poles=[-1e3, -1e3, -1e3, -1e3]"],
             [SHAPED, "design.poles=[-10, -10, -10, -10]"]),
        Case(LOOSER, ["cranectl design lqr+loop-shaping", STRONGEST, WEAK],
             ["cranectl design lqr+loop-shaping", STRONGEST, "design.input_weight=1e6"]),
        Case(LOOSER, [SHAPED, HIGH, "design.loop_shaping.integral=1e-6"], [SHAPED, HIGH]),
    ],
    "tools/robustness/certificate/operating_points.py": [
        Case("choose other rope lengths, or set rig.rope_range", f"{CERTIFY} --rope-length 9",
             f"{CERTIFY} --rope-length 1", [f"{CERTIFY} --rope-length 9", "rig.rope_range=[0.05, 10.0]"]),
        Case("choose a smaller tilt or a shorter rope", f"{CERTIFY} --rope-length 1 --tilt 80 0",
             f"{CERTIFY} --rope-length 1 --tilt 0.1 0"),
    ],
}  # fmt: skip


test_a_remedy_works_on_the_refused_input = remedy_test(CASES, "")
