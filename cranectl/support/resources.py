"""Find the model, scenarios, campaigns and tolerances, in the wheel or in the checkout beside it."""

from pathlib import Path

from cranectl.support.errors import InputError, did_you_mean
from cranectl.support.files import exists

_PACKAGE = Path(__file__).parents[1]
_INSTALLED = _PACKAGE / "_data"
_ROOT = _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parent

MODEL_FILE = _ROOT / "models" / "crane.xml"
SCENARIO_DIRECTORY = _ROOT / "validation" / "scenarios"
RIG_DIRECTORY = _ROOT / "validation" / "rigs"
TOLERANCE_FILE = _ROOT / "validation" / "tolerances.toml"
THESIS_DIRECTORY = _ROOT / "validation" / "thesis"
CAMPAIGN_DIRECTORY = _ROOT / "validation" / "campaigns"
BENCHMARK_DIRECTORY = _ROOT / "validation" / "benchmark"
REGRESSION_DIRECTORY = _ROOT / "validation" / "regression"


def toml_names(directory: Path) -> list[str]:
    """Return the names of the TOML files in one of the directories above."""
    return sorted(path.stem for path in directory.glob("*.toml"))


def toml_file(kind: str, name_or_path: str, directory: Path) -> Path:
    """Return the file of a name in `directory`, or of a path; raise InputError if there is none."""
    names, path = toml_names(directory), Path(name_or_path)
    if name_or_path in names:
        return directory / f"{name_or_path}.toml"
    if exists(path) and path.is_dir():
        raise InputError(
            f"{name_or_path} is a directory",
            allowed=f"a {kind} by name or the path of its file",
            remedy="name a file in it, or another",
        )
    if exists(path):
        return path
    beside = sorted(file.name for file in path.parent.glob("*.toml")) if exists(path.parent) else []
    raise InputError(
        f"cannot read {name_or_path}: no such file or directory"
        if is_path(name_or_path)
        else f"unknown {kind} '{name_or_path}', which is no file or directory either",
        allowed=f"the path of a TOML file, or by name {', '.join(names)}",
        remedy=did_you_mean(path.name, [*names, *beside]) or "choose one of these, or correct the path",
    )


def is_path(name_or_path: str) -> bool:
    """Return True if the text is a path to a file: it has a directory or a file ending."""
    return "/" in name_or_path or Path(name_or_path).suffix != ""
