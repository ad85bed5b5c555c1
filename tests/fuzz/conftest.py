"""A directory with files as a user may have them: logs, settings, the result of a campaign, notes."""

import contextlib
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from cranectl.cli.main import main

SCENARIO = """name = "s"
duration = 0.02
reference.start = [1.0, 0.77, -0.7]
"""
CAMPAIGN = """name = "c"
scenario = "./s.toml"
controllers = ["lqr"]
plants = ["analytic"]
runs = 2
uncertain.rig.load_mass = {distribution = "uniform", low = 0.5, high = 2.0}
"""
TEXTS = {
    "s.toml": SCENARIO, "c.toml": CAMPAIGN, "rig.toml": "load_mass = 2.0\n", "notes.txt": "my notes\n",
    "old.json": "{\n}\n",
}  # fmt: skip


@pytest.fixture(scope="session")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("template")
    for name, text in TEXTS.items():
        (directory / name).write_text(text)
    (directory / "sub").mkdir()
    with contextlib.chdir(directory):
        assert main(["run", "s.toml", "--out", "x.mcap", "--every", "1"]) == 0
        assert main(["campaign", "run", "c.toml", "--out", "r"]) == 0
    content = (directory / "x.mcap").read_bytes()
    (directory / "cut.mcap").write_bytes(content[: 2 * len(content) // 3])
    (directory / "copy.mcap").write_bytes(content)
    (directory / "link.mcap").symlink_to("x.mcap")
    return directory


NewDirectory = Callable[[], Path]


@pytest.fixture(scope="session")
def new_directory(template: Path, tmp_path_factory: pytest.TempPathFactory) -> NewDirectory:
    """Return a function that makes a directory with the scenario, since each test runs many cases."""

    def make() -> Path:
        directory = tmp_path_factory.mktemp("new")
        shutil.copy(template / "s.toml", directory)
        return directory

    return make
