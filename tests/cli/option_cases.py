"""Messages that name an option: refused commands, commands that follow the remedy, or why there are none."""

from typing import NamedTuple

from tests.loaders.controller_files import LAW

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
FILES = {
    "short.toml": f'name = "short"\n{SHORT}',
    "own.toml": f'name = "own"\ncontroller = "law.py:damper"\n{SHORT}',
    "law.py": LAW,
    "many.toml": MANY,
}
# A refused command, a part of its remedy, and the command that follows the remedy.
PARTIAL_CASES = [
    (
        "run short.toml --plants mujoco --set effects.limits={}",
        "take '--drive velocity'",
        "run short.toml --plants mujoco --set effects.limits={} --drive velocity",
    ),
    (
        "run short.toml --plants mujoco --set effects.limits={}",
        "or leave the effect out",
        "run short.toml --plants mujoco",
    ),
    (
        "run short.toml --plants analytic --drive velocity --set effects.rope={}",
        "take '--plants elastic,mujoco'",
        "run short.toml --plants elastic,mujoco --drive velocity --set effects.rope={}",
    ),
    ("run own.toml --plants analytic", "add --trust", "run own.toml --plants analytic --trust"),
    (
        "run own.toml --plants analytic",
        "name it: --controller PATH",
        "run own.toml --plants analytic --controller law.py:damper",
    ),
    ("log overlay two.mcap", "with --plants all", "log overlay two.mcap --plants all --out over.mcap"),
    ("log overlay two.mcap", "name another log", "log overlay two.mcap one.mcap --out over.mcap"),
    (
        "log layout overlay view.json",
        "name such a log with --log",
        "log layout overlay view.json --log over.mcap",
    ),
    ("compare one.mcap", "name a second log", "compare one.mcap two.mcap"),
    ("compare one.mcap", "run with --plants all", "run short.toml --plants all"),
    ("render one.mcap a.gif --time 0.1", "name a .png", "render one.mcap a.png --time 0.1"),
    ("log export one.mcap --out a.table", "add --format", "log export one.mcap --out a.table --format csv"),
    (
        "campaign run many.toml --out result",
        "complete it with --resume",
        "campaign run many.toml --out result --resume",
    ),
    (
        "campaign run many.toml --out result",
        "with --overwrite",
        "campaign run many.toml --out result --overwrite",
    ),
    ("campaign run many.toml --out result", "choose another --out", "campaign run many.toml --out another"),
    (
        "campaign run many.toml --plants drake",
        "take '--plants mujoco'",
        "campaign run many.toml --plants mujoco",
    ),
    ("campaign replay result --run 7", "choose another with --run", "campaign replay result --run 0"),
    (
        "certify lqr-integral --tilt 10 0 --delay 0.01",
        "take --tilt 0 0 and --hoisting-speed 0",
        "certify lqr-integral --tilt 0 0 --hoisting-speed 0 --delay 0.01",
    ),
]

OFFSET = "initial.load_offset=[0.001,0,0]"
SLOW = """\
import time
has_slept = []
def slow(parameters, measured, reference, memory, command):
    if not has_slept:
        has_slept.append(time.sleep(1.5))
    command[:] = 0.0
    return 0
"""
FILES |= {
    "longer.toml": 'name = "short"\nduration = 0.4\n' + SHORT.partition("\n")[2],
    "other.toml": MANY.replace("runs = 1", "runs = 2"),
    "pid.toml": f'name = "pid"\ncontroller = "pid"\n{SHORT}',
    "slow.py": SLOW,
    "file": "of another kind",
    "full/notes.txt": "of another kind",
}


class Case(NamedTuple):
    """A text of a source file, the command that is refused with it, and commands that follow its remedy."""

    source: str
    text: str
    refused: str
    remedied: tuple[str, ...]


DESIGN = "design lqr --scenario short.toml"
RUN, CAMPAIGN = "run short.toml --plants", "campaign run many.toml --out"
MERGE = "compare one.mcap {} --merge merged.mcap"
CASES = [
    Case("analysis/certificate/loop.py", "choose another signal with --open-at, or leave it out",
         "certify lqr-integral --open-at v --delay 0.01",
         ("certify lqr-integral --open-at u --delay 0.01", "certify lqr-integral --delay 0.01")),
    Case("campaign/results.py", "choose another place with --out", f"{CAMPAIGN} full", (f"{CAMPAIGN} new",)),
    Case("campaign/results.py", "choose another place with --out, or remove the result",
         "campaign run other.toml --out result --resume", ("campaign run other.toml --out new",)),
    Case("cases/case.py",
         "change the 'name' in one of the files, or run them one by one with other --out",
         "validate short.toml longer.toml --plants analytic --controller lqr --drive ideal",
         ("run short.toml --plants analytic --out a.mcap", "run longer.toml --plants analytic --out b.mcap",
          "validate short.toml renamed.toml --plants analytic --controller lqr --drive ideal")),
    Case("cli/compare.py", "add --merge FILE", "compare one.mcap mujoco.mcap --despite-differences",
         ("compare one.mcap mujoco.mcap --despite-differences --merge merged.mcap",)),
    Case("cli/compare.py", "name two directories of logs, NEW and GOLDEN, and --tolerances",
         "compare newer golden", ("compare newer golden --tolerances exact",)),
    Case("cli/design.py", "add --fmu FILE", f"{DESIGN} --fmi 3", (f"{DESIGN} --fmi 3 --fmu lqr.fmu",)),
    Case("cli/design.py", "add --export DIR", f"{DESIGN} --real float",
         (f"{DESIGN} --real float --export as-floats",)),
    Case("cli/design.py", "leave out --drive, or add --export DIR", f"{DESIGN} --drive velocity",
         (DESIGN, f"{DESIGN} --drive velocity --export as-c")),
    Case("cli/design.py", "choose another place with --fmu", f"{DESIGN} --fmu file/a.fmu",
         (f"{DESIGN} --fmu a.fmu",)),
    Case("cli/run.py", "name one: --plants analytic", "run short.toml --fmu crane.fmu",
         ("run short.toml --plants analytic --fmu crane.fmu",)),
    Case("cli/run.py", "add --fmu FILE", "run short.toml --plants analytic --fmi 3",
         ("run short.toml --plants analytic --fmi 3 --fmu crane.fmu",)),
    Case("export/plant.py", "take '--plants {}'", "run short.toml --plants mujoco --fmu crane.fmu",
         ("run short.toml --plants analytic --fmu crane.fmu",)),
    Case("cli/new.py", "choose another name, or another --in", "new scenario short --in there",
         ("new scenario short --in elsewhere", "new scenario another --in there")),
    Case("cli/output.py", "choose another place with --json", "info one.mcap --json file/a.json",
         ("info one.mcap --json a.json",)),
    Case("cli/report.py", "choose another directory with --figures",
         "report one.mcap --out page.html --figures file",
         ("report one.mcap --out page.html --figures pictures",)),
    Case("cli/report.py", "report on fewer at a time; for the levels of a ladder use "
         "cranectl ladder --report FILE",
         "report one.mcap two.mcap mujoco.mcap offset.mcap coarse.mcap --out page.html",
         ("report one.mcap two.mcap --out page.html",
          "ladder short.toml --controller lqr --top sampled --report page.html")),
    Case("cli/validate.py", "add --controller {}", "validate pid.toml --plants analytic --drive ideal",
         ("validate pid.toml --plants analytic --drive ideal --controller pid",)),
    Case("compare/golden.py", "run again with the golden log's --every",
         "compare coarse.mcap one.mcap --tolerances exact",
         (f"{RUN} analytic --every 4 --out coarse.mcap", "compare coarse.mcap one.mcap --tolerances exact")),
    Case("compare/runs.py", "compare them without --merge", MERGE.format("again.mcap"),
         ("compare one.mcap again.mcap",)),
    Case("compare/runs.py", "run one of them again, or merge with --despite-differences: the log then "
         "describes the {} run's scenario and the installed versions", MERGE.format("offset.mcap"),
         (f"{MERGE.format('offset.mcap')} --despite-differences", MERGE.format("mujoco.mcap"))),
    Case("log/export.py", "choose another place with --out", "log export one.mcap --out file/a.csv",
         ("log export one.mcap --out a.csv",)),
    Case("log/overlay.py", "choose other labels with --label",
         "log overlay one.mcap two.mcap --label a --label mujoco --out new.mcap",
         ("log overlay one.mcap two.mcap --label a --label b --out new.mcap",)),
    Case("log/overlay.py", "give --label once for each run, or not at all",
         "log overlay one.mcap two.mcap --label a --out new.mcap",
         ("log overlay one.mcap two.mcap --label a --label b --out new.mcap",
          "log overlay one.mcap two.mcap --out new.mcap")),
    Case("log/recover.py", "choose another place with --out", "log recover again.mcap.4711.part",
         ("log recover again.mcap.4711.part --out saved.mcap",)),
    Case("log/writer.py", "choose another place with --out", f"{RUN} analytic --out file/a.mcap",
         (f"{RUN} analytic --out a.mcap",)),
    Case("plants/capabilities.py", "{} or '--drive force'; or set {}",
         f"{RUN} mujoco --set effects.friction.viscous=[1,1,1]",
         (f"{RUN} mujoco --set effects.friction.viscous=[1,1,1] --drive velocity",
          f"{RUN} mujoco --set effects.friction.viscous=[1,1,1] --drive force", f"{RUN} mujoco")),
    Case("render/draw.py", "choose a higher --speed or a lower --fps, or an .mp4",
         "render four.mcap a.gif --size 400x300 --speed 0.01 --fps 60",
         ("render four.mcap a.gif --size 400x300 --speed 4 --fps 2",)),
    Case("render/draw.py", "choose a moment with --time", "render one.mcap a.png --fps 5",
         ("render one.mcap a.png --time 0.1",)),
    Case("render/draw.py", "for example --size 1280x720", "render one.mcap a.png --size 5x5",
         ("render one.mcap a.png --size 1280x720",)),
    Case("render/draw.py", "leave out --time to see the load farthest from its reference",
         "render one.mcap a.png --time 9", ("render one.mcap a.png",)),
    Case("scenario/settings.py", "for example --set rig.load_mass=2.5", f"{RUN} analytic --set rig.load_mass",
         (f"{RUN} analytic --set rig.load_mass=2.5",)),
]  # fmt: skip
# The logs in `prepared_files`, and the commands that make them.
LOGS = {
    "one.mcap": f"{RUN} analytic",
    "again.mcap": f"{RUN} analytic",
    "coarse.mcap": f"{RUN} analytic --every 20",
    "four.mcap": f"{RUN} analytic --set duration=0.6",
    "mujoco.mcap": f"{RUN} mujoco",
    "offset.mcap": f"{RUN} mujoco --set {OFFSET}",
    "two.mcap": f"{RUN} analytic,mujoco",
}

# Messages that need more than a command; `test_option_remedies.py` has a test for each.
DIFFERENCES = (
    "install those, choose another place with --out, or add --despite-differences (and "
    "--resume for 'campaign run'): the result then lists the software of its runs"
)
ROOM = "make room and go on with --resume: finished batches are kept"
WAIT = "wait for it, or choose another place with --out"
BEGAN = "the command that began it and --resume"
FIXED = "add {}, or choose other plants with --plants"
DISTURBED = "{}, or add --set 'disturbances=[]'"
DRIVE = "take '--drive {}'"

HERE = "executed in test_option_remedies.py"
FOUND = "describes the found input"
COMMAND = "tests/cli/test_suggestions.py: a whole command is suggested"
DASK = "starts programs on other machines; tests/campaign/test_cluster.py runs on workers of Dask"
BENCHMARK = "repeats the run in a new directory; tests/campaign/benchmark/test_commands.py has one"
PYTEST = "tests/cli/test_pytest_plugin.py"
OF_CONTROLLERS = "tests/cli/test_key_remedies_controllers.py"
# By file and a part of the text: the test that follows it, or the reason why none does.
KNOWN = {
    **dict.fromkeys((("campaign/results.py", text) for text in (DIFFERENCES, ROOM, WAIT, BEGAN)), HERE),
    **dict.fromkeys((("plants/capabilities.py", text) for text in (FIXED, DISTURBED, DRIVE)), HERE),
    ("plants/capabilities.py", "--set rig.{}={}"): HERE,
    ("simulate/child.py", "--timeout allows more"): HERE,
    ("cli/controller_options.py", "--patience is now --timeout"): "tests/simulate/test_child.py",
    ("plants/mujoco/own_file.py", "add --set rig.plant.names.{}=NAME"): "tests/plants/test_own_model.py",
    ("plants/mujoco/own_model.py", "name the end of the rope as load"): "tests/plants/test_own_model.py",
    ("plants/capabilities.py", " in place of the model"): "tests/plants/test_own_model.py",
    ("cli/validate.py", "and {} more, with --details"): "tests/cli/test_validate_cli.py",
    ("cli/design.py", "add --scenario fast-diagonal, or another one"): OF_CONTROLLERS,
    ("cli/design.py", "choose another place with --export"): OF_CONTROLLERS,
    ("export/package.py", "add --set duration={}"): "tests/export/test_design_command.py",
    ("export/single.py", "export it with doubles, without --real"): "tests/export/test_single.py",
    ("cli/compare.py", "--despite-differences without --merge"): FOUND,
    ("cli/compare.py", "--merge and one log"): FOUND,
    ("cli/compare.py", "--tolerances and --merge"): FOUND,
    ("cli/compare.py", "--tolerances and one log"): FOUND,
    ("scenario/settings.py", "--set {}"): FOUND,
    ("cli/idle.py", "--timeout changes nothing here"): FOUND,
    ("cli/benchmark.py", "--tuned changes nothing here"): FOUND,
    ("cli/command.py", " --log {}"): COMMAND,
    ("cli/measured.py", "take --replay commands, or other --plants"): "tests/measured/test_runs.py",
    ("cli/new.py", "run it: cranectl run fast-diagonal --controller {}"): "tests/cli/test_new.py",
    ("cli/new.py", "cranectl log import RECORDED.csv --map {}"): "tests/measured/test_programme.py",
    ("measured/programme.py", "leave --period out, or choose"): "tests/measured/test_programme.py",
    (
        "controllers/preparation.py",
        "add --set control.period={} to the",
    ): "tests/loaders/test_c_controller.py",
    ("cli/ladder.py", "leave out {}, or --predict"): "tests/analysis/budget/test_budget.py",
    ("cli/identify.py", "judge runs that were not used"): "tests/measured/test_identification.py",
    ("cli/measured.py", "cranectl validate LOG --rig identified.toml"): "tests/measured/test_verdict.py",
    ("cli/measured.py", "write --tolerance 5mm"): "tests/measured/test_verdict.py",
    ("measured/verdict.py", "identify the crane again, with --out"): "tests/measured/test_verdict.py",
    ("measured/experiment.py", "add --replay motion"): "tests/measured/test_identification.py",
    ("cli/ladder.py", "cranectl log layout ladder view.json --log {}"): COMMAND,
    ("cli/log.py", "cranectl log layout overlay view.json --log {}"): COMMAND,
    ("cases/drive_use.py", "see what comes of it with --drive velocity"): COMMAND,
    ("campaign/cluster.py", "go on with the same command and --resume"): DASK,
    ("campaign/cluster.py", "start it again, and go on with --resume"): DASK,
    ("campaign/cluster.py", "start `dask scheduler --host IP`"): DASK,
    ("campaign/cluster.py", "start some with `dask worker {}"): DASK,
    ("analysis/certificate/certify.py", "take '--drive velocity'"): "`certify` offers no force drives",
    ("campaign/benchmark/results.py", "name their directory with --tuned"): BENCHMARK,
    ("campaign/benchmark/results.py", "run it again in another directory with --out"): BENCHMARK,
    ("campaign/benchmark/tuning.py", "raise --runs"): "tests/campaign/benchmark/test_tuning.py",
    ("cases/assertions.py", "pytest --cranectl-update keeps it"): PYTEST,
    ("cli/pytest_plugin.py", "write it with pytest --cranectl-update"): PYTEST,
    ("cli/benchmark.py", "leave out --scenario or --set-of-cranes"): BENCHMARK,
    (
        "cli/campaign/run.py",
        "the same command and --resume",
    ): "occurs only if a manifest is changed during the run",
    ("cli/idle.py", "--drive velocity --plants elastic,mujoco "): "tests/cli/test_idle_effects.py",
    ("cli/idle.py", "--set effects.{}={}"): "tests/cli/test_idle_effects.py",
    ("cli/validate.py", "more notes, in --report FILE"): "the page of every validation has all notes",
    ("live/guard.py", "start again with --allow-origin {}"): "tests/live/test_guard.py",
    ("live/hand.py", "start with --set reference.segments=[]"): "tests/live/test_hand.py",
    ("live/recorder.py", "choose another place with --record"): "tests/live/test_recorder.py",
    ("live/viewers.py", "choose another port with --port"): "tests/live/test_live.py",
    (
        "report/theme.py",
        "choose another file with --plot",
    ): "occurs only if the disk becomes full during writing",
}
