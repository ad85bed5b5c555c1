"""What a controller imports and reads from its folder: its own, part of its digest, and taken to workers."""

import pickle
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.campaign.results import PARTS
from cranectl.cli.main import main
from cranectl.controllers.registry import ALL_CONTROLLERS, OPEN, SharedControllers
from cranectl.loaders.opening import close_controllers, open_again, open_controller
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError
from tests.loaders.controller_files import campaign_file, scenario
from tests.tools.export.loaders.test_process_controller import PROGRAM

STEP = """
def NAME(parameters, measured, reference, memory, command):
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        rate = -reference[5] if axis == 2 else reference[3 + axis]
        command[axis] = K * (target - measured[2 * axis]) + 8.0 * (rate - measured[2 * axis + 1])
    return 0
"""
PARTS_OF_A_LAW = {  # ways to have K beside the file: imports of the file, then what lies beside it
    "module": ("from gains import K", {"gains.py": "K = VALUE"}),
    "named module": ("import gains as g\nK = g.K", {"gains.py": "K = VALUE"}),
    "module of a module": ("from gains import K", {"gains.py": "from more import K", "more.py": "K = VALUE"}),
    "package": (
        "import tables.of.gains\nK = tables.of.gains.K",
        {
            "tables/__init__.py": "",
            "tables/of/__init__.py": "from . import gains",
            "tables/of/gains.py": "from ..more import K",
            "tables/more.py": "K = VALUE",
        },
    ),
    "folder without __init__": ("from tables.gains import K", {"tables/gains.py": "K = VALUE"}),
    "name of the standard library": ("from statistics import K", {"statistics.py": "K = VALUE"}),
    "folder of its own choice": (
        "import sys\nfrom pathlib import Path\n"
        "sys.path.insert(0, str(Path(__file__).parent / '../NAME-lib'))\nfrom gains import K",
        {"../NAME-lib/gains.py": "K = VALUE"},
    ),
    "data": (
        "import json\nfrom pathlib import Path\n"
        "K = json.loads(Path(__file__).with_name('gains.json').read_text())",
        {"gains.json": "VALUE"},
    ),
    "array": (
        "import numpy as np\nfrom pathlib import Path\n"
        "K = float(np.loadtxt(Path(__file__).parent / 'data' / 'gains.csv'))",
        {"data/gains.csv": "VALUE"},
    ),
}
ways = pytest.mark.parametrize("way", PARTS_OF_A_LAW)


@pytest.fixture(autouse=True)
def the_path_of_imports_stays() -> Iterator[None]:
    path = sys.path[:]
    yield
    assert sys.path == path


def written(folder: Path, name: str, value: float, way: str = "module") -> str:
    """A law `name` in `folder` whose gain is `value`; returns how it is named."""
    folder.mkdir(exist_ok=True)
    head, parts = PARTS_OF_A_LAW[way]
    (folder / "law.py").write_text((head + STEP).replace("NAME", name))
    for part, text in parts.items():
        path = folder / part.replace("NAME", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.replace("VALUE", str(value)))
    return f"{folder}/law.py:{name}"


def gain_of(law: Any) -> float:
    """What a step commands for a bridge 1 m away."""
    command, memory = np.zeros(3), np.zeros(64)
    law.step(np.zeros(1), np.zeros(12), np.eye(15)[0], memory, command)
    return float(command[0])


def gain(name: str) -> float:
    return gain_of(ALL_CONTROLLERS[name])


@ways
def test_each_controller_has_the_modules_and_data_of_its_own_folder(way: str, tmp_path: Path) -> None:
    before = set(sys.modules)
    first = open_controller(written(tmp_path / "a", "first", 16.0, way))
    second = open_controller(written(tmp_path / "b", "second", 4.25, way))
    assert (gain(first), gain(second)) == (16.0, 4.25)
    assert not {name for name in set(sys.modules) - before if name.partition(".")[0] in ("gains", "tables")}
    assert not list(tmp_path.rglob("__pycache__"))


@ways
def test_what_lies_beside_it_counts_in_its_digest(way: str, tmp_path: Path) -> None:
    """Whatever the time of the change: within the second, and of the same length."""

    def digests(value: float) -> dict[str, str]:
        assert open_controller(written(tmp_path / "a", "first", value, way)) == "first"
        assert gain("first") == value
        return ALL_CONTROLLERS.digests(["first"])

    before = digests(16.0)
    (tmp_path / "a" / "unrelated.py").write_text("K = 3.0")
    assert digests(16.0) == before != digests(17.0)
    assert digests(16.0) == before


def travelled(shared: SharedControllers) -> SharedControllers:
    """Return the controllers as a worker of a cluster gets them."""
    return SharedControllers(pickle.loads(pickle.dumps(shared.files)))


@ways
@pytest.mark.parametrize("then", ["gone", "changed"])
def test_workers_have_what_lay_beside_it_when_it_was_opened(way: str, then: str, tmp_path: Path) -> None:
    asked = written(tmp_path / "a", "first", 16.0, way)
    name = open_controller(asked)
    files, digests = travelled(OPEN.share()), ALL_CONTROLLERS.digests([name])
    close_controllers()
    for folder in tmp_path.iterdir():
        shutil.rmtree(folder)
    if then == "changed":
        written(tmp_path / "a", "first", 17.0, way)
    open_again(files)
    open_again(files)
    assert gain(name) == 16.0
    assert ALL_CONTROLLERS.digests([name]) == digests


def test_a_worker_keeps_versions_of_one_name_apart(tmp_path: Path) -> None:
    """One that serves two campaigns has both, whichever came last."""
    sent, designs = [], []
    for value in (16.0, 4.25):
        name = open_controller(written(tmp_path / "a", "first", value))
        sent.append(OPEN.share())
        close_controllers()
    for shared in sent:
        open_again(shared)
        designs.append(ALL_CONTROLLERS.design(name, scenario()))
    assert [gain_of(ALL_CONTROLLERS.of_design(design)) for design in designs] == [16.0, 4.25]


def test_the_same_text_in_two_folders_is_two_controllers(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    texts = {}
    for folder, value in (("a", 16.0), ("b", 4.0)):
        texts[folder] = written(tmp_path / folder, "first", value).rpartition(":")[0]
    assert Path(texts["a"]).read_bytes() == Path(texts["b"]).read_bytes()
    open_controller(f"{texts['a']}:first")
    with pytest.raises(InputError, match="are two controllers named 'first'"):
        open_controller(f"{texts['b']}:first")
    assert gain("first") == 16.0


def test_nothing_is_imported_from_there_later(tmp_path: Path) -> None:
    """It would count in no digest; what the file has imported is there."""
    asked = written(tmp_path / "a", "first", 16.0)
    law = tmp_path / "a" / "law.py"
    text = law.read_text().replace("    for axis", "    from MODULE import NAME\n    for axis")
    (tmp_path / "a" / "later.py").write_text("K = 1.0")
    for module, imported in (("gains", "K"), ("math", "pi")):
        law.write_text(text.replace("MODULE", module).replace("NAME", imported))
        assert gain(open_controller(asked)) == 16.0
    law.write_text(text.replace("MODULE", "later").replace("NAME", "K"))
    name = open_controller(asked)
    later = r"later lies beside the controller.*at the top of the file"
    with pytest.raises(ModuleNotFoundError, match=later):
        gain(name)


def test_a_module_that_fails_is_named_as_the_user_knows_it(tmp_path: Path) -> None:
    asked = written(tmp_path / "a", "first", 16.0)
    for gains, found in (
        ("from nowhere_at_all import K", r"law\.py:1: ModuleNotFoundError: No module named 'nowhere_at_all'"),
        ("\nK = 1 +", r"gains\.py:2: SyntaxError"),
        ("", r"law\.py:1: ImportError: cannot import name 'K' from 'gains'"),
    ):
        (tmp_path / "a" / "gains.py").write_text(gains)
        with pytest.raises(InputError, match=found):
            open_controller(asked)


# Processes


def peer(folder: Path, *, gain: float, program: str = "peer.py", more: str = "") -> str:
    """A program whose gain is in a module beside it; returns how it is named."""
    folder.mkdir(exist_ok=True)
    text = (
        PROGRAM.replace("16.0", "K")
        .replace("BROKEN", "pass")
        .replace("import os", "from gains import K\nimport os")
    )
    (folder / "peer.py").write_text(text)
    (folder / "gains.py").write_text(f"K = {gain}")
    (folder / "law.toml").write_text(
        f'name = "peer"\nprogram = ["{sys.executable}", "{program}"]\nlogged = ["error"]\n{more}'
    )
    return f"{folder}/law.toml"


FILES = 'files = ["gains.py", "data/*.csv"]\n'


def test_the_files_of_a_program_count_and_travel(tmp_path: Path) -> None:
    (tmp_path / "a" / "data").mkdir(parents=True)
    (tmp_path / "a" / "data" / "table.csv").write_text("1,2")
    asked = peer(tmp_path / "a", gain=16.0, more=FILES)
    name = open_controller(asked)
    first = ALL_CONTROLLERS.digests([name])
    files, run = travelled(OPEN.share()), simulate_run(scenario(), plant="analytic", controller=name)
    for changed in ("peer.py", "gains.py", "data/table.csv"):
        path = tmp_path / "a" / changed
        text = path.read_text()
        path.write_text(f"{text}MORE = 1\n")
        assert open_controller(asked) == name
        assert ALL_CONTROLLERS.digests([name]) != first
        path.write_text(text)
    assert open_controller(asked) == name
    assert ALL_CONTROLLERS.digests([name]) == first
    close_controllers()
    peer(tmp_path / "a", gain=4.0, more=FILES)
    open_again(files)
    again = simulate_run(scenario(), plant="analytic", controller=name)
    assert ALL_CONTROLLERS.digests([name]) == first
    assert np.array_equal(run.block("state"), again.block("state"))
    close_controllers()
    other = simulate_run(scenario(), plant="analytic", controller=open_controller(asked))
    assert not np.array_equal(run.block("state"), other.block("state"))


def test_a_campaign_is_not_resumed_with_another_helper(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    campaign_file(written(tmp_path / "a", "first", 16.0), runs=1)
    run = ["campaign", "run", "own.toml", "--out", "result", "--trust"]
    assert main(run) == 0
    last = sorted(Path("result", PARTS).glob("*.parquet"))[-1]
    last.unlink()
    close_controllers()
    written(tmp_path / "a", "first", 4.0)
    assert main([*run, "--resume"]) == 2
    assert "made by other software: law " in capsys.readouterr().err
    assert not last.exists()
    close_controllers()
    written(tmp_path / "a", "first", 16.0)
    assert main([*run, "--resume"]) == 0
    assert last.exists()
