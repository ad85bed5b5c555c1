"""Every numeric option of every command at odd numbers: a result, or what is wrong with it, and never 70.

Options are found from the commands themselves, so that one that is added is tried too. `make test` takes a
share of the cases, the same each time; RANGE_CASES=all takes all.
"""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest

from cranectl.cli.main import cli, main
from tests.cli.test_remedies import MANY, SHORT

NUMBERS = ("0", "1", "-1", "1e-300", "1e300", "nan", "inf", str(10**12), str(2**63))
SHARE = 40
# By command and option, the rest of a command line that is quick.
SMALL = {
    "run": "run short.toml --plants analytic --out own.mcap",
    "validate": "validate short.toml --plants analytic --jobs 1",
    "campaign run": "campaign run many.toml --out other",
    "campaign show": "campaign show many.toml",
    "campaign replay": "campaign replay result",
    "certify": "certify lqr",
    "render": "render one.mcap one.gif --size 160x120",
    "render --time": "render one.mcap one.png --size 160x120",
    "live": "live short.toml --plants analytic",
    "tune": "tune lqr-integral",
    "benchmark run": "benchmark run --controller lqr-integral",
}
# What a command takes and then works on for as long as it was told to.
LONG = {
    "live --speed": ("1",),
    "live --port": ("0", "1"),
    "tune": ("1", str(10**12), str(2**63), "1e-300"),
    "benchmark run": ("1", str(10**12), str(2**63), "1e-300"),
    "certify": ("1",),  # a rope, a delay or a lag of 1: half a minute
}
# Found by the first run of all cases.
FOUND = [
    ("campaign replay", "--every", str(2**63)),
    ("certify", "--tilt", "nan"),
    *(("certify", "--hoisting-speed", value) for value in ("1e300", "nan", "inf")),
]


def numeric_options(command: click.Command, path: tuple[str, ...] = ()) -> Iterator[tuple[str, str, int]]:
    """Command, option and how many numbers it takes, of all options of numbers."""
    if isinstance(command, click.Group):
        for name, below in command.commands.items():
            yield from numeric_options(below, (*path, name))
        return
    for each in command.params:
        kind = each.type.types[0] if isinstance(each.type, click.Tuple) else each.type
        numbers = (click.types.IntParamType, click.types.FloatParamType)
        if isinstance(each, click.Option) and isinstance(kind, numbers):
            yield " ".join(path), each.opts[0], each.nargs


OPTIONS = list(numeric_options(cli))
CASES = [
    (command, option, nargs, value)
    for command, option, nargs in OPTIONS
    for value in NUMBERS
    if value not in (*LONG.get(command, ()), *LONG.get(f"{command} {option}", ()))
]
ALL = os.environ.get("RANGE_CASES") == "all"
CHOSEN = set(np.random.default_rng(1).permutation(len(CASES))[: len(CASES) if ALL else SHARE].tolist())


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log and a result of a campaign."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "short.toml").write_text(f'name = "short"\n{SHORT}')
    (folder / "many.toml").write_text(MANY)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["run", "short.toml", "--plants", "analytic", "--out", "one.mcap"]) == 0
        assert main(["campaign", "run", "many.toml", "--out", "result"]) == 0
    return folder


@pytest.mark.parametrize(
    ("command", "option", "nargs", "value"),
    [case for k, case in enumerate(CASES) if k in CHOSEN or (*case[:2], case[3]) in FOUND],
)
def test_an_odd_number_gives_a_result_or_what_is_wrong_with_it(
    command: str, option: str, nargs: int, value: str,
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    shutil.copytree(made, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    capsys.readouterr()
    line = SMALL.get(f"{command} {option}") or SMALL[command]
    if f" {option} " in line:
        line = line.partition(f" {option} ")[0]
    code = main([*line.split(), option, *[value] * nargs])
    told = capsys.readouterr().err
    assert code in (0, 1, 2, 3), told
    assert "Traceback" not in told
    if code == 2:
        assert "Invalid value" in told or ("found:" in told and "remedy:" in told), told


def test_every_numeric_option_is_tried() -> None:
    assert {command for command, *_ in OPTIONS} == {name.partition(" --")[0] for name in SMALL}
    assert len(OPTIONS) > 25
