"""Remedies that name an option: each is taken on the very command that was refused, and works."""

import re
from pathlib import Path

import pytest

from cranectl.cli.main import main
from tests.loaders.law_files import LAW

pytestmark = pytest.mark.usefixtures("in_copy")

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
# What is typed and refused, what the remedy says, and what is typed then.
CASES = [
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


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of one plant and of two, an overlay of them, and a result of a campaign."""
    folder = tmp_path_factory.mktemp("made")
    for name, text in FILES.items():
        (folder / name).write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name, plants in (("one", "analytic"), ("two", "analytic,mujoco")):
            assert main(["run", "short.toml", "--plants", plants, "--out", f"{name}.mcap"]) == 0
        assert main(["log", "overlay", "one.mcap", "two.mcap", "--out", "over.mcap"]) == 0
        assert main(["campaign", "run", "many.toml", "--out", "result"]) == 0
    return folder


@pytest.mark.parametrize(("refused", "told", "taken"), CASES)
def test_a_remedy_works_on_what_was_refused(
    refused: str, told: str, taken: str, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert main(refused.split()) == 2
    remedy = re.search("remedy:(.*)", capsys.readouterr().err)
    assert remedy is not None
    assert told in remedy[1]
    assert main(taken.split()) in (0, 1), "it is run and judged"
