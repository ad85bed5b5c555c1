"""Remedies that name a key or a value of a campaign work on the refused input."""

from tests.remedies import Case, remedy_test, written

RUN = "campaign run c.toml --out result --overwrite"
SCENARIO = "name='s'\nduration=0.1\nreference.start=[1.0, 0.77, -0.7]\n"
CAMPAIGN = """name='c'
scenario='s.toml'
controllers=['lqr']
uncertain.rig.load_mass={distribution='uniform', low=0.8, high=1.2}
"""
FILES = {
    "open.toml": SCENARIO + "disturbances=[{joint='alpha', magnitude=1.0, start=0.02}]\n",
    "s.toml": SCENARIO + "disturbances=[{joint='alpha', magnitude=1.0, start=0.02, end=0.05}]\n",
    "grid.toml": CAMPAIGN,
    "c.toml": f"{CAMPAIGN}runs=2\n",
    "twice.toml": f"{CAMPAIGN}uncertain.'rig.load_mass'={{distribution='fixed', value=1.0}}\n",
}
UNIFORM = "{distribution='uniform', low=0.8, high=1.2}"
MASS, GRAVITY = "uncertain.rig.load_mass", "uncertain.rig.gravity"
GRID, CORRELATED = "sampling='grid'", "correlation=[{between=['rig.load_mass', 'rig.gravity'], value=0.5}]"
OTHER_GRAVITY = f"{GRAVITY}={{distribution='uniform', low=9.7, high=9.9}}"
DISTRIBUTION = (
    "write [uncertain.{}] with 'distribution = ...' below it, "
    "or check that [uncertain.{}] has a 'distribution'"
)
ROPE = "uncertain.rig.rope_range.1={distribution='uniform', low=1.3, high=1.4}"
MASS_GRAVITY = "{between=['rig.load_mass', 'rig.gravity'], value=0.9}"
MASS_ROPE = "{between=['rig.load_mass', 'rig.rope_range.1'], value=0.9}"
GRAVITY_ROPE = "{between=['rig.gravity', 'rig.rope_range.1'], value=0.9}"
NO_END = "scenario='open.toml'"
END = "uncertain.disturbances.0.end={distribution='choice', values=[0.05, 0.06]}"
GRID_CAMPAIGN = "cranectl campaign run grid.toml --out result --overwrite"
SALTELLI = "sampling='saltelli'"
IDEAL = "drive='ideal'"
LAGGING = "uncertain.rig.bridge_time_constant={distribution='uniform', low=0.04, high=0.06}"
CASES = {
    "campaign/settings.py": [
        Case("remove one of the two tables", "cranectl campaign run twice.toml --out result --overwrite", ""),
        Case(DISTRIBUTION, f"{GRAVITY}=9.8", f"{GRAVITY}={{distribution='fixed', value=9.8}}"),
    ],
    "support/errors.py": [
        Case("did you mean '{}'?", f"{MASS}.distribution='uniformly'", f"{MASS}.distribution='uniform'"),
    ],
    "campaign/definition.py": [
        Case("did you mean '{}'?", f"uncertain.rig.loadmass={UNIFORM}", f"{MASS}={UNIFORM}"),
        Case("choose a number of the scenario", f"uncertain.zzz={UNIFORM}", f"{MASS}={UNIFORM}"),
        Case('take \'distribution = "choice"\' with "values", such as [{}]',
             "uncertain.control.period={distribution='uniform', low=0.001, high=0.002}",
             "uncertain.control.period={distribution='choice', values=[0.001, 0.002, 0.005]}"),
        Case("give it one in the scenario or by 'set = [\"{}=...\"]'", [NO_END, END],
             [NO_END, END, "set=['disturbances.0.end=0.05']"]),
        Case("choose a number of the scenario", f"uncertain.disturbances.0.joint={UNIFORM}",
             f"{MASS}={UNIFORM}"),
        Case("run one campaign for each value",
             "uncertain.design.input_weight={distribution='uniform', low=0.1, high=0.2}",
             "set=['design.input_weight=0.2']"),
        Case("take 'distribution = \"integers\"', which draws a whole number for every run",
             ["set=['effects.wind={}']",
              "uncertain.effects.wind.seed={distribution='uniform', low=1.0, high=9.0}"],
             ["set=['effects.wind={}']", "uncertain.effects.wind.seed={distribution='integers'}"]),
        Case("give absolute numbers and leave 'relative' out",
             "uncertain.initial.alpha_offset={distribution='uniform', low=0.9, high=1.1, relative=true}",
             "uncertain.initial.alpha_offset={distribution='uniform', low=0.0, high=0.1}"),
        Case("correct mean, low or high",
             f"{MASS}={{distribution='normal', mean=1.0, deviation=0.001, low=5.0, high=6.0}}",
             f"{MASS}={{distribution='normal', mean=1.0, deviation=0.001, low=0.9, high=1.1}}"),
        Case("widen the range or take 'distribution = \"choice\"'",
             "uncertain.disturbances.0.end={distribution='uniform', low=0.0501, high=0.0509}",
             "uncertain.disturbances.0.end={distribution='uniform', low=0.05, high=0.06}",
             "uncertain.disturbances.0.end={distribution='choice', values=[0.05, 0.06]}"),
        Case("give each of them a distribution", f"uncertain.rig.rope_range={UNIFORM}",
             "uncertain.rig.rope_range.1={distribution='uniform', low=1.3, high=1.4}"),
    ],
    "campaign/load.py": [
        Case("leave the correlations out or take another sampling", [GRID, OTHER_GRAVITY, CORRELATED],
             [OTHER_GRAVITY, CORRELATED]),
        Case("leave it out, or choose other plants or drives", [IDEAL, LAGGING], IDEAL, LAGGING),
        Case("add 'levels = 5' to [uncertain.{}]", [GRID_CAMPAIGN, GRID],
             [GRID_CAMPAIGN, GRID, f"{MASS}.levels=5"]),
        Case("take fewer levels or another sampling",
             [GRID_CAMPAIGN, GRID, f"{MASS}.levels=10000", OTHER_GRAVITY, f"{GRAVITY}.levels=1000"],
             [GRID_CAMPAIGN, GRID, f"{MASS}.levels=2", OTHER_GRAVITY, f"{GRAVITY}.levels=2"]),
        Case("take another sampling, or give a parameter another distribution than fixed",
             [SALTELLI, f"{MASS}={{distribution='fixed', value=1.0}}"], [SALTELLI, "runs=3"]),
        Case("remove 'runs' or correct it", [GRID, f"{MASS}.levels=3"], [GRID, f"{MASS}.levels=3", "runs=3"]),
        Case("take 'runs = {}'", ["sampling='saltelli'", "runs=7"], ["sampling='saltelli'", "runs=12"]),
    ],
    "campaign/sampling.py": [
        Case("weaken the correlations between {}, or name the missing pairs",
             [OTHER_GRAVITY, ROPE, f"correlation=[{MASS_GRAVITY}, {MASS_ROPE}]"],
             [OTHER_GRAVITY, ROPE, f"correlation=[{MASS_GRAVITY}, {MASS_ROPE}, {GRAVITY_ROPE}]"],
             [OTHER_GRAVITY, ROPE, f"correlation=[{MASS_GRAVITY}, {MASS_ROPE}]".replace("0.9", "0.2")]),
        Case("leave the correlation out or take another distribution",
             [f"{GRAVITY}={{distribution='choice', values=[9.7, 9.9]}}", CORRELATED],
             f"{GRAVITY}={{distribution='choice', values=[9.7, 9.9]}}", [OTHER_GRAVITY, CORRELATED]),
        Case("remove this correlation", [OTHER_GRAVITY, CORRELATED.replace("rig.gravity", "rig.load_mass")],
             OTHER_GRAVITY),
    ],
}  # fmt: skip


files = written(FILES)
test_a_remedy_works_on_the_refused_input = remedy_test(CASES, RUN)
