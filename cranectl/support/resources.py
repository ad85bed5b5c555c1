"""Find the model, scenarios, campaigns and tolerances, in the wheel or in the checkout beside it."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from cranectl.support.errors import InputError
from cranectl.support.files import File

_PACKAGE = Path(__file__).parents[1]
_INSTALLED = _PACKAGE / "_data"
_ROOT = _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parent


@dataclass(frozen=True)
class Shipped:
    """A kind of document that comes with cranectl: users name it without folder and ending.

    Parameters
    ----------
    kind : str
        In messages.
    folder : Path
        With a TOML file for each document.
    """

    kind: str
    folder: Path

    SCENARIOS: ClassVar["Shipped"]
    RIGS: ClassVar["Shipped"]
    CAMPAIGNS: ClassVar["Shipped"]
    BENCHMARKS: ClassVar["Shipped"]
    REGRESSIONS: ClassVar["Shipped"]  # tolerances for comparisons with golden logs
    MODEL_FILE: ClassVar = _ROOT / "models" / "crane.xml"
    TOLERANCE_FILE: ClassVar = _ROOT / "validation" / "tolerances.toml"
    THESIS_FOLDER: ClassVar = _ROOT / "validation" / "thesis"

    @staticmethod
    def is_path(name_or_path: str) -> bool:
        """Return True if the text is a path to a file: it has a directory or a file ending."""
        return "/" in name_or_path or Path(name_or_path).suffix != ""

    def names(self) -> list[str]:
        """Return the names of the documents."""
        return sorted(path.stem for path in self.folder.glob("*.toml"))

    def file(self, name_or_path: str) -> Path:
        """Return the file of a name, or of a path; raise InputError if there is none."""
        names, path = self.names(), Path(name_or_path)
        if name_or_path in names:
            return self.folder / f"{name_or_path}.toml"
        if File(path).exists() and path.is_dir():
            raise InputError(
                f"{name_or_path} is a directory",
                allowed=f"a {self.kind} by name or the path of its file",
                remedy="name a file in it, or another",
            )
        if File(path).exists():
            return path
        beside = (
            sorted(file.name for file in path.parent.glob("*.toml")) if File(path.parent).exists() else []
        )
        raise InputError(
            f"cannot read {name_or_path}: no such file or directory"
            if self.is_path(name_or_path)
            else f"unknown {self.kind} '{name_or_path}', which is no file or directory either",
            allowed=f"the path of a TOML file, or by name {', '.join(names)}",
            remedy=InputError.did_you_mean(path.name, [*names, *beside])
            or "choose one of these, or correct the path",
        )


Shipped.SCENARIOS = Shipped("scenario", _ROOT / "validation" / "scenarios")
Shipped.RIGS = Shipped("rig", _ROOT / "validation" / "rigs")
Shipped.CAMPAIGNS = Shipped("campaign", _ROOT / "validation" / "campaigns")
Shipped.BENCHMARKS = Shipped("benchmark", _ROOT / "validation" / "benchmark")
Shipped.REGRESSIONS = Shipped("tolerance file", _ROOT / "validation" / "regression")
