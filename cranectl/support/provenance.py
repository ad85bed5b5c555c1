"""Record what decides the numbers of a run besides its input: sources, models, data, packages, machine.

Logs and results carry this record, so that results of other software can be told apart. Fingerprints cover
the relative names and contents of released files, so a checkout and its wheel have the same ones. For a
package that adds metrics or plants they cover all its files. For a single module they cover the modules that
it imports from its folder.
"""

import ast
import functools
import hashlib
import importlib.metadata
import importlib.util
import platform
import sys
from collections.abc import Iterable, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from cranectl.support import Shipped
from cranectl.support.extensions import COUNTED

UNKNOWN = "unknown"  # of what wrote it before it said so


def _package_digest(package: str) -> str:
    try:
        spec = importlib.util.find_spec(package)
    except ValueError:  # a module without a spec, such as a script
        file = getattr(sys.modules[package], "__file__", None)
        return _module_digest(Path(file)) if file and Path(file).is_file() else UNKNOWN
    if spec is None or not spec.has_location or spec.origin is None:
        return UNKNOWN
    origin = Path(spec.origin)
    one_file = spec.submodule_search_locations is None
    return _module_digest(origin) if one_file else _folder_digest(origin.parent)


@functools.cache
def _folder_digest(folder: Path) -> str:
    return fingerprint(folder, _files_in(folder))


def _files_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts]


@functools.cache
def _module_digest(path: Path) -> str:
    """Return a digest of a module without a package, and of the modules that it imports from its folder."""
    folder, waiting, seen = path.parent, [path], {path}
    while waiting and folder.name not in Provenance.INSTALLED:  # other packages lie there too
        for name in _imported(waiting.pop()) - {"cranectl"}:
            module, package = folder / f"{name}.py", folder / name
            new = {module} if module.is_file() else set(_files_in(package)) if package.is_dir() else set()
            waiting += [path for path in new - seen if path.suffix == ".py"]
            seen |= new
    return fingerprint(folder, seen)


def _imported(path: Path) -> set[str]:
    """Return the top-level names of all modules that a source file imports."""
    try:
        nodes = list(ast.walk(ast.parse(path.read_bytes())))
    except (SyntaxError, ValueError):  # not a Python source file
        return set()
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    return {name.partition(".")[0] for name in names}


def fingerprint(root: Path, paths: Iterable[Path]) -> str:
    """Return a digest of files and their names below `root`; line endings do not count."""
    digest = hashlib.sha256()
    for name, path in sorted((path.relative_to(root).as_posix(), path) for path in paths):
        content = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()[: Provenance.DIGITS]


def _text(node: object) -> str:
    """Return a node and its fields as text, the same in all versions of Python; empty fields are left out."""
    if isinstance(node, ast.JoinedStr):
        return f"JoinedStr({_text(_merged(node.values))})"
    if isinstance(node, ast.AST):
        # `kind` is only the u of u"text".
        fields = [(name, getattr(node, name, None)) for name in node._fields if name != "kind"]
        inner = (f"{name}={_text(value)}" for name, value in fields if value not in (None, []))
        return f"{type(node).__name__}({','.join(inner)})"
    if isinstance(node, list):
        return f"[{','.join(map(_text, node))}]"
    return repr(node)


def _merged(parts: list[Any]) -> list[Any]:
    """Return the parts of a formatted string, with adjacent texts joined and empty texts removed."""
    merged: list[Any] = []
    for is_text, group in groupby(parts, lambda part: isinstance(part, ast.Constant)):
        if not is_text:
            merged += group
        elif text := "".join(str(part.value) for part in group):
            merged.append(text)
    return merged


class Provenance:
    """Versions and fingerprints that decide the numbers of a run, by name."""

    PACKAGES = (
        "cranectl",
        "mujoco",
        "numpy",
        "scipy",
        "numba",
        "llvmlite",
        "control",
        "ctrlsys",
        "foxglove-sdk",
    )
    FINGERPRINTS = ("sources", "models", "data")
    HARMLESS = ("python", "foxglove-sdk")  # versions that affect no number of a run
    INSTALLED = ("site-packages", "dist-packages")  # folders of packages
    DIGITS = 16  # of a fingerprint, hexadecimal

    @classmethod
    def now(cls) -> dict[str, str]:
        """Return versions and fingerprints of this program by name; the first time takes some 10 ms."""
        return {**cls.installed(), **cls.fingerprints(), **cls.extensions()}

    @staticmethod
    @functools.cache
    def fingerprints() -> dict[str, str]:
        """Return digests of the package's sources, the models and the scenarios, campaigns and limits."""
        package = Path(__file__).parents[1]
        sources = (path for path in package.rglob("*.py") if "_data" not in path.parts[len(package.parts) :])
        models, data = Shipped.MODEL_FILE.parent, Shipped.TOLERANCE_FILE.parent
        # Results of a benchmark hold all that its files say: one controller more, or one tuned, changes no
        # other. Proofs are in the checkout only, and no run reads them.
        apart = {Shipped.BENCHMARKS.folder, data / "proofs"}
        said = (path for path in data.rglob("*.toml") if apart.isdisjoint(path.parents))
        return {
            "sources": fingerprint(package, sources),
            "models": fingerprint(models, models.rglob("*.xml")),
            "data": fingerprint(data, said),
        }

    @staticmethod
    @functools.cache
    def installed() -> dict[str, str]:
        """Return the versions of Python and of the packages that decide numbers, and the kind of machine."""
        versions = {name: importlib.metadata.version(name) for name in Provenance.PACKAGES}
        return {"python": platform.python_version(), **versions, "machine": platform.machine()}

    @staticmethod
    @functools.cache
    def extensions() -> dict[str, str]:
        """Return versions of the packages that add metrics or plants, and digests of their sources."""
        entries = [entry for point in COUNTED for entry in importlib.metadata.entry_points(group=point.group)]
        versions = {entry.dist.name: entry.dist.version for entry in entries if entry.dist}
        return versions | Provenance.sources_of(entry.module for entry in entries)

    @staticmethod
    def sources_of(modules: Iterable[str]) -> dict[str, str]:
        """Return digests of all files of foreign packages with `modules`: `sources of crane_plants`."""
        packages = {module.partition(".")[0] for module in modules} - {"cranectl"}
        return {f"sources of {package}": _package_digest(package) for package in sorted(packages)}

    @classmethod
    def differences(
        cls, versions: Mapping[str, str], now: Mapping[str, str], *, word: str = "now", harmless: bool = False
    ) -> list[str]:
        """Return which versions may explain different numbers, such as `sources 12ab, now 34cd`.

        A version that one of them lacks is unknown, and an unknown version always counts as different. `word`
        replaces `now`. If `harmless`, the result includes versions that affect no number.
        """
        names = dict.fromkeys([*now, *versions, *cls.FINGERPRINTS])
        pairs = [(name, versions.get(name, UNKNOWN), now.get(name, UNKNOWN)) for name in names]
        return [
            f"{name} {one}, {word} {other}"
            for name, one, other in pairs
            if (one != other or one == UNKNOWN) and (harmless or name not in cls.HARMLESS)
        ]

    @classmethod
    def others(cls, made_by: Mapping[str, Mapping[str, str]]) -> dict[str, list[str]]:
        """Return each difference from the installed software, with the labels to which it applies."""
        others: dict[str, list[str]] = {}
        for label, versions in made_by.items():
            for difference in cls.differences(versions, cls.now()):
                others.setdefault(difference, []).append(label)
        return others

    @staticmethod
    def syntax_of(content: bytes) -> bytes:
        """Return the syntax tree of Python source as text, without comments and docstrings.

        So these do not affect a digest. The text does not depend on the version of Python. Docstrings stay
        if the source contains ``__doc__``. Content that is not valid Python is returned unchanged.
        """
        try:
            tree = ast.parse(content)
        except (SyntaxError, ValueError):
            return content
        if b"__doc__" not in content:
            documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
            for node in ast.walk(tree):
                if isinstance(node, documented) and ast.get_docstring(node, clean=False) is not None:
                    del node.body[0]
        return _text(tree).encode()
