"""What tells one program from another: every source, model and data file, nothing else."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cranectl.support.provenance import Provenance, fingerprint
from cranectl.support.resources import Shipped
from tests.conftest import ROOT

ASKED = """
import json
from cranectl.support.provenance import Provenance
print(json.dumps(Provenance.fingerprints()))
"""


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout, for each test to change and to put right again."""
    return copy_checkout(tmp_path_factory.mktemp("checkout"))


def copy_checkout(to: Path) -> Path:
    for name in ("cranectl", "models", "validation"):
        shutil.copytree(ROOT / name, to / name, ignore=shutil.ignore_patterns("__pycache__"))
    return to


def asked(checkout: Path) -> dict[str, str]:
    """What the copied program says of itself."""
    found = subprocess.run(
        [sys.executable, "-c", ASKED], cwd=checkout, capture_output=True, text=True, check=True
    )
    return json.loads(found.stdout)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ("cranectl/model/dynamics.py", "sources"),
        ("cranectl/cli/main.py", "sources"),
        ("models/crane.xml", "models"),
        ("validation/tolerances.toml", "data"),
        ("validation/thesis/printed.toml", "data"),
        ("validation/scenarios/fast-diagonal.toml", "data"),
        ("validation/campaigns/lab-rig.toml", "data"),
        ("validation/regression/exact.toml", "data"),
        ("validation/performance/performance.py", None),
        ("validation/benchmark/literature.toml", None),
        ("models/notes.md", None),
    ],
)
def test_one_changed_file_is_named(copied: Path, changed: str, named: str | None) -> None:
    path = copied / changed
    before = path.read_bytes() if path.exists() else None
    with path.open("ab") as file:
        file.write(b"# ")
    try:
        now = asked(copied)
    finally:
        if before is None:
            path.unlink()
        else:
            path.write_bytes(before)
    differ = [name for name in Provenance.FINGERPRINTS if now[name] != Provenance.fingerprints()[name]]
    assert differ == ([named] if named else [])
    assert Provenance.now().keys() == {"python", *Provenance.PACKAGES, "machine", *Provenance.FINGERPRINTS}


def test_everything_shipped_is_covered() -> None:
    """A mesh beside the model, or a table in another format, would go unnoticed.

    Pictures, schemas, what the benchmark has found decide nothing; laws, some in C, have their own digests.
    """
    assert {"mujoco", "numba", "llvmlite", "numpy", "scipy", "control", "ctrlsys"} <= set(Provenance.PACKAGES)
    models, data = Shipped.MODEL_FILE.parent, Shipped.TOLERANCE_FILE.parent
    kinds = {path.suffix for path in models.rglob("*") if path.is_file()}
    assert kinds == {".xml"}
    shipped = [path for path in data.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    found = {path for path in shipped if path.suffix == ".parquet"}
    assert all(path.is_relative_to(Shipped.BENCHMARKS.folder) for path in found)
    assert {path.suffix for path in {*shipped} - found} == {".toml", ".py", ".svg", ".json", ".c"}
    for place in (Shipped.SCENARIOS.folder, Shipped.THESIS_FOLDER, Shipped.CAMPAIGNS.folder):
        assert place.is_relative_to(data)


def test_names_and_contents_count_and_line_endings_do_not(tmp_path: Path) -> None:
    def of(files: dict[str, bytes]) -> str:
        paths = [tmp_path / name for name in files]
        for path, content in zip(paths, files.values(), strict=True):
            path.write_bytes(content)
        return fingerprint(tmp_path, reversed(paths))

    same = of({"a": b"1\n", "b": b"2"})
    assert len(same) == 16
    assert of({"a": b"1\r\n", "b": b"2"}) == same
    others = ({"a": b"2", "b": b"1\n"}, {"a": b"1\n", "c": b"2"}, {"a": b"1\n"}, {"a": b"1\n2"})
    assert len({same, *map(of, others)}) == 5


def test_differences_are_named_and_unknown_is_one() -> None:
    now = {"python": "3.11", "mujoco": "4.0.0", "sources": "ab", "models": "cd", "data": "ef"}
    assert Provenance.differences(now, now) == []
    other = now | {"python": "3.12", "sources": "12"}
    assert Provenance.differences(other, now) == ["sources 12, now ab"]
    assert Provenance.differences(other, now, harmless=True, word="here") == [
        "python 3.12, here 3.11",
        "sources 12, here ab",
    ]
    old = {"python": "3.11", "mujoco": "4.0.0"}
    unknown = ["sources unknown, now ab", "models unknown, now cd", "data unknown, now ef"]
    assert Provenance.differences(old, now) == unknown
    assert len(Provenance.differences(old, old)) == 3, "of two that do not tell nobody knows"
    assert Provenance.differences(now, old)[0] == "sources ab, now unknown"
    assert Provenance.differences(now | {"numba": "1"}, now) == ["numba 1, now unknown"]
