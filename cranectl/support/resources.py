"""Where the model, scenarios, campaigns and tolerances lie: in the wheel, or in the checkout beside it."""

from pathlib import Path

from cranectl.support.errors import InputError, unknown_name

_PACKAGE = Path(__file__).parents[1]
_INSTALLED = _PACKAGE / "_data"
_ROOT = _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parent

MODEL_FILE = _ROOT / "models" / "crane.xml"
SCENARIO_DIRECTORY = _ROOT / "validation" / "scenarios"
RIG_DIRECTORY = _ROOT / "validation" / "rigs"
TOLERANCE_FILE = _ROOT / "validation" / "tolerances.toml"
THESIS_DIRECTORY = _ROOT / "validation" / "thesis"
CAMPAIGN_DIRECTORY = _ROOT / "validation" / "campaigns"
REGRESSION_DIRECTORY = _ROOT / "validation" / "regression"


def toml_names(directory: Path) -> list[str]:
    """Names of the TOML files in one of the directories above."""
    return sorted(path.stem for path in directory.glob("*.toml"))


def toml_file(kind: str, name_or_path: str, directory: Path) -> Path:
    """The file of a name in `directory`, or any by its path; raises InputError for an unknown name."""
    names = toml_names(directory)
    if name_or_path in names:
        return directory / f"{name_or_path}.toml"
    if name_or_path.endswith(".toml") or "/" in name_or_path:
        return Path(name_or_path)
    if Path(name_or_path).is_dir():
        raise InputError(
            f"{name_or_path} is a directory", allowed=f"a {kind} by name or the path of its file"
        )
    raise unknown_name(kind, name_or_path, names)
