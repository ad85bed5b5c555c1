"""Remedies that name an option, the commands that they refuse, and commands that follow them."""

from tests.loaders.controller_files import LAW
from tests.remedies import Case, Cases

SHORT = "duration = 0.3\nreference = { start = [1.0, 0.77, -0.7] }\n"
MANY = """\
name = "many"
scenario = "short.toml"
controllers = ["lqr"]
plants = ["analytic"]
runs = 1
[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.8
high = 1.2
"""
SLOW = """\
import time
has_slept = []
def slow(parameters, measured, reference, memory, command):
    if not has_slept:
        has_slept.append(time.sleep(1.5))
    command[:] = 0.0
    return 0
"""
FILES = {
    "short.toml": f'name = "short"\n{SHORT}',
    "own.toml": f'name = "own"\ncontroller = "law.py:damper"\n{SHORT}',
    "longer.toml": f'name = "short"\n{SHORT}'.replace("0.3", "0.4"),
    "renamed.toml": f'name = "longer"\n{SHORT}'.replace("0.3", "0.4"),
    "many.toml": MANY,
    "other.toml": MANY.replace("runs = 1", "runs = 2"),
    "crane.toml": "load_mass = 2.0\n",
    "law.toml": "colour = 'red'\n",
    "rows.csv": "time,bridge\n0.0,1.0\n0.1,1.1\n",
    "law.py": LAW,
    "slow.py": SLOW,
    "file": "of another kind",
    "full/notes.txt": "of another kind",
}
DESIGN = "design lqr --scenario short.toml"
EXPORT = f"{DESIGN} --real float --drive velocity --export c"
CERTIFY = "certify lqr-integral --delay 0.01 --hoisting-speed 0 --rope-length 0.7"
RUN, CAMPAIGN = "run short.toml --plants", "campaign run many.toml --out"
VALIDATE = "validate short.toml {} --plants analytic --controller lqr --drive ideal"
MERGE = "compare one.mcap {} --merge merged.mcap"
VISCOUS = f"{RUN} mujoco --set effects.friction.viscous=[1,1,1]"
# The logs in `prepared_files`, and the commands that make them.
LOGS = {
    "one.mcap": f"{RUN} analytic",
    "again.mcap": f"{RUN} analytic",
    "coarse.mcap": f"{RUN} analytic --every 20",
    "four.mcap": f"{RUN} analytic --set duration=0.6",
    "mujoco.mcap": f"{RUN} mujoco",
    "offset.mcap": f"{RUN} mujoco --set initial.load_offset=[0.001,0,0]",
    "two.mcap": f"{RUN} analytic,mujoco",
}
CASES: Cases = {
    "tools/robustness/certificate/certify.py": [
        Case("take --tilt 0 0 and --hoisting-speed 0, and no mean wind",
             f"{CERTIFY} --tilt 10 0", f"{CERTIFY} --tilt 0 0"),
    ],
    "tools/robustness/certificate/operating_points.py": [
        Case("name fewer of them, and certify in parts",
             CERTIFY + " --tilt 0 0" * 2001, f"{CERTIFY} --tilt 0 0"),
    ],
    "cli/counts.py": [
        Case("choose such a number, or leave {} out", VALIDATE.format("--jobs 1000000000"),
             VALIDATE.format("--jobs 1"), VALIDATE.format("")),
    ],
    "tools/robustness/certificate/loop.py": [
        Case("choose another signal with --open-at, or leave it out",
             f"{CERTIFY} --tilt 0 0 --open-at v",
             f"{CERTIFY} --tilt 0 0 --open-at u", f"{CERTIFY} --tilt 0 0"),
    ],
    "campaign/replay.py": [
        Case("choose another with --run", "campaign replay result --run 7", "campaign replay result --run 0"),
    ],
    "campaign/results.py": [
        Case("complete it with --resume, replace it with --overwrite, or choose another --out",
             f"{CAMPAIGN} result", f"{CAMPAIGN} result --resume", f"{CAMPAIGN} result --overwrite",
             f"{CAMPAIGN} another"),
        Case("choose another place with --out", f"{CAMPAIGN} full", f"{CAMPAIGN} new"),
        Case("choose another place with --out, or remove the result",
             "campaign run other.toml --out result --resume", "campaign run other.toml --out new"),
    ],
    "cases/case.py": [
        Case("change the 'name' in one of the files, or run them one by one with other --out",
             VALIDATE.format("longer.toml"), f"{RUN} analytic --out a.mcap",
             "run longer.toml --plants analytic --out b.mcap", VALIDATE.format("renamed.toml")),
    ],
    "cli/compare.py": [
        Case("add --merge FILE", "compare one.mcap mujoco.mcap --despite-differences",
             "compare one.mcap mujoco.mcap --despite-differences --merge merged.mcap"),
        Case("name two directories of logs, NEW and GOLDEN, and --tolerances", "compare newer golden",
             "compare newer golden --tolerances exact"),
        Case("run with --plants all, or name a second log", "compare one.mcap", f"{RUN} all",
             "compare one.mcap two.mcap"),
    ],
    "cli/design.py": [
        Case("add --export DIR", f"{DESIGN} --real float", EXPORT),
        Case("leave out --drive, or add --export DIR", f"{DESIGN} --drive velocity", DESIGN, EXPORT),
        Case("choose another place with --fmu", f"{DESIGN} --fmi 3 --fmu file/lqr.fmu",
             f"{DESIGN} --fmi 3 --fmu lqr.fmu"),
    ],
    "campaign/failures.py": [
        Case("write --max-failures 5%", "campaign report result --max-failures 0.05",
             "campaign report result --max-failures 5%"),
    ],
    "campaign/commands/options.py": [
        Case("add --max-failures 5%", "campaign report result --junit junit.xml",
             "campaign report result --junit junit.xml --max-failures 5%"),
    ],
    "cli/info.py": [
        Case("leave out --as-is", "info short.toml --as-is", "info short.toml"),
        Case("leave these options out", "info one.mcap --set duration=1", "info one.mcap"),
    ],
    "cli/info_settings.py": [
        Case("leave out --rig", "info crane.toml --rig lab-rig", "info crane.toml"),
        Case("see the keys of a rig by: cranectl list --schema rig", "info law.toml", "info crane.toml"),
        Case("cranectl run fast-diagonal --controller {}{}", "info law.py",
             "run fast-diagonal --controller law.py:damper --set duration=0.3 --set disturbances=[] "
             "--set reference.segments=[] --plants analytic"),
        Case("name one of these; a measured file gets a map by: cranectl new map {}", "info rows.csv",
             "info crane.toml", "new map rows.csv"),
    ],
    "cli/controller_options.py": [
        Case("name one of them, or run all: cranectl validate SCENARIO --controller {}",
             "run short.toml --plants analytic --controller law.py:damper,lqr",
             "run short.toml --plants analytic --controller lqr",
             "validate short.toml --plants analytic --controller law.py:damper,lqr --drive ideal"),
    ],
    "cli/log.py": [
        Case("name another log, or the plants of this one with --plants all", "log overlay two.mcap",
             "log overlay two.mcap one.mcap --out over.mcap",
             "log overlay two.mcap --plants all --out over.mcap"),
    ],
    "cli/new.py": [
        Case("choose another name, or another --in", "new scenario short --in there",
             "new scenario short --in elsewhere", "new scenario another --in there"),
    ],
    "cli/output.py": [
        Case("choose another place with --json", "info one.mcap --json file/a.json",
             "info one.mcap --json a.json"),
    ],
    "cli/refused_options.py": [
        Case("add --fmu FILE", f"{DESIGN} --fmi 3", f"{DESIGN} --fmi 3 --fmu lqr.fmu"),
        Case("add --fmu FILE", f"{RUN} analytic --fmi 3", f"{RUN} analytic --fmi 3 --fmu crane.fmu"),
    ],
    "cli/report.py": [
        Case("choose another directory with --figures", "report one.mcap --out page.html --figures file",
             "report one.mcap --out page.html --figures pictures"),
        Case("report on fewer at a time; for the levels of a ladder use cranectl ladder --report FILE",
             "report one.mcap two.mcap mujoco.mcap offset.mcap coarse.mcap --out page.html",
             "report one.mcap two.mcap --out page.html",
             "ladder short.toml --controller lqr --top sampled --report page.html"),
    ],
    "cli/run.py": [
        Case("name one: --plants analytic", "run short.toml --fmu crane.fmu",
             f"{RUN} analytic --fmu crane.fmu"),
    ],
    "scenario/origins.py": [
        Case("leave this --set out", "info crane.toml --set duration=2", "info crane.toml",
             "info crane.toml --set rig.load_mass=3.0"),
    ],
    "compare/golden.py": [
        Case("run again with the golden log's --every", "compare coarse.mcap one.mcap --tolerances exact",
             f"{RUN} analytic --every 4 --out coarse.mcap",
             "compare coarse.mcap one.mcap --tolerances exact"),
    ],
    "compare/runs.py": [
        Case("compare them without --merge", MERGE.format("again.mcap"), "compare one.mcap again.mcap"),
        Case("run one of them again, or merge with --despite-differences: the log then describes the {} "
             "run's scenario and the installed versions", MERGE.format("offset.mcap"),
             MERGE.format("mujoco.mcap"), f"{MERGE.format('offset.mcap')} --despite-differences"),
    ],
    "controllers/registry.py": [
        Case("if you know what is in it, add --trust, or name it: --controller PATH",
             "run own.toml --plants analytic", "run own.toml --plants analytic --trust",
             "run own.toml --plants analytic --controller law.py:damper"),
        Case("if you know what is in it, add --trust, or name it: --controller PATH",
             "validate own.toml --drive ideal", "validate own.toml --drive ideal --trust",
             "validate own.toml --drive ideal --controller law.py:damper"),
    ],
    "tools/export/plant.py": [
        Case("take '--plants {}'", f"{RUN} mujoco --fmu crane.fmu", f"{RUN} analytic --fmu crane.fmu"),
    ],
    "log/export.py": [
        Case("choose another place with --out", "log export one.mcap --out file/a.csv",
             "log export one.mcap --out a.csv"),
        Case("choose such an ending, or add --format", "log export one.mcap --out a.table",
             "log export one.mcap --out a.csv", "log export one.mcap --out a.table --format csv"),
    ],
    "log/overlay.py": [
        Case("choose other labels with --label",
             "log overlay one.mcap two.mcap --label a --label mujoco --out new.mcap",
             "log overlay one.mcap two.mcap --label a --label b --out new.mcap"),
        Case("give --label once for each run, or not at all",
             "log overlay one.mcap two.mcap --label a --out new.mcap",
             "log overlay one.mcap two.mcap --label a --label b --out new.mcap",
             "log overlay one.mcap two.mcap --out new.mcap"),
    ],
    "log/recover.py": [
        Case("choose another place with --out", "log recover again.mcap.4711.part",
             "log recover again.mcap.4711.part --out saved.mcap"),
    ],
    "log/writer.py": [
        Case("choose another place with --out", f"{RUN} analytic --out file/a.mcap",
             f"{RUN} analytic --out a.mcap"),
    ],
    "plants/capabilities.py": [
        Case("{} or '--drive force'; or set {}", VISCOUS, f"{VISCOUS} --drive velocity",
             f"{VISCOUS} --drive force", f"{RUN} mujoco"),
        Case("{}, or leave the effect out", f"{RUN} mujoco --set effects.limits={{}}", f"{RUN} mujoco",
             f"{RUN} mujoco --set effects.limits={{}} --drive velocity"),
        Case("{}, or leave the effect out", f"{RUN} analytic --drive velocity --set effects.rope={{}}",
             f"{RUN} elastic,mujoco --drive velocity --set effects.rope={{}}"),
    ],
    "plants/entry.py": [
        Case("take '--plants {}', and {} for single runs", "campaign run many.toml --plants drake",
             "campaign run many.toml --plants mujoco"),
    ],
    "plants/mujoco/drawn_rig.py": [
        Case("did you mean '{}'?", "render one.mcap a.png --camera sid",
             "render one.mcap a.png --camera side"),
        Case("leave out --camera for the overview", "render one.mcap a.png --camera x",
             "render one.mcap a.png"),
    ],
    "tools/render/draw.py": [
        Case("choose a higher --speed or a lower --fps, or an .mp4",
             "render four.mcap a.gif --size 400x300 --speed 0.01 --fps 60",
             "render four.mcap a.gif --size 400x300 --speed 4 --fps 2"),
        Case("choose a moment with --time", "render one.mcap a.png --fps 5",
             "render one.mcap a.png --time 0.1"),
        Case("for example --size 1280x720", "render one.mcap a.png --size 5x5",
             "render one.mcap a.png --size 1280x720"),
        Case("leave out --time to see the load farthest from its reference",
             "render one.mcap a.png --time 9", "render one.mcap a.png"),
        Case("leave out --time, or name a .png", "render one.mcap a.gif --time 0.1",
             "render one.mcap a.gif", "render one.mcap a.png --time 0.1"),
    ],
    "report/viewer_layouts.py": [
        Case("name such a log with --log", "log layout overlay view.json",
             "log layout overlay view.json --log over.mcap"),
    ],
}  # fmt: skip
