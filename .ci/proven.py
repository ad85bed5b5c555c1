"""Run a slow set of tests only where something that it depends on has changed since the last full pass.

    python .ci/proven.py SET -- COMMAND...            run the command, unless the set is unchanged
    python .ci/proven.py SET --always -- COMMAND...   run the command, and record the set if it passes

SET is a name in SETS below. A set depends on its tests, on every module that these import directly or through
others, on data files, on constraints.txt and on the version of Python. Comments and docstrings do not count.
`.ci/proven.json` records the last full pass of each set; `make test-all` writes it, and so does each target
of a set with ALL=1. That pass takes --always, which also fails a test that reads a file that its set does not
list.
"""

import argparse
import ast
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from cranectl.support.provenance import Provenance
from cranectl.support.sources import exported, module_files

ROOT = Path(__file__).resolve().parents[1]
RECORD = ".ci/proven.json"
DIGITS = 16  # of a digest, hexadecimal
GENERATED = {"__pycache__", ".pytest_cache", "logs"}  # folders that hold compiled code and results
LIMITS = ("PLAN_CASES", "DRAKE_CASES")  # variables that limit the number of cases
FILES = "PROVEN_FILES"  # names the list of a set's files; tests/conftest.py fails a run that reads others
PACKAGES = ("cranectl", "docs", "tests", "validation", "viewer")
NAMED_MODULE = re.compile(rf"((?:{'|'.join(PACKAGES)})(?:\.\w+)+)(?::\w+)?")  # where a registry names a class
DATA = ("models/**/*", "validation/scenarios/*", "validation/rigs/*", "validation/tolerances.toml")
DATA += ("cranectl/**/*.h", "cranectl/**/*.pyi", "constraints.txt")


@dataclass(frozen=True)
class Set:
    """The files of a set by patterns below ROOT: its tests and modules, and the data that they read."""

    modules: tuple[str, ...]  # with all that these import
    data: tuple[str, ...] = ()
    without: tuple[str, ...] = ()  # files that are left out, unless a module imports them


# What is imported by a computed name, such as a command, is named here.
PACKAGE = ("cranectl/**/*.py", "validation/**/*.py")  # for tests that run many commands
PACKAGE_DATA = ("cranectl/**/*", "validation/**/*")
RESULTS = tuple(f"validation/{name}/**/*" for name in ("performance", "proofs", "thesis"))  # pages read them
PAGES = ("docs/**/*", "examples/**/*", "*.md", "LICENSE", "CITATION.cff", "pyproject.toml")
TOOLS = (
    "tools/robustness",
    "campaign",
    "cases",
    "tools/export",
    "fuzz",
    "tools/live",
    "loaders",
    "tools/measured",
)
TOOLS += ("tools/render", "report")
SETS = {
    "core": Set(  # its slow tests
        modules=(*PACKAGE, "tests/**/*.py"),
        data=(*PACKAGE_DATA, *PAGES, "tests/**/*"),
    ),
    "tools": Set(
        modules=(*PACKAGE, *(f"tests/{name}/**/*.py" for name in TOOLS)),
        data=(
            *PACKAGE_DATA,
            *(f"tests/{name}/**/*" for name in TOOLS),
            "tests/plants/models/**/*",
            "tests/log/samples/*",
            "docs/how-to/live.md",
            "docs/pictures/run.png",
        ),
    ),
    "docs": Set(
        modules=(*PACKAGE, "docs/**/*.py", "tests/**/*.py"),  # pages name tests
        data=(*PACKAGE_DATA, *PAGES, "tests/**/*"),
    ),
    "literature": Set(
        modules=(
            "tests/benchmark/*.py",
            "tests/tools/benchmark/*.py",
            "validation/benchmark/**/*.py",
            "cranectl/tools/benchmark/commands/benchmark.py",
            "cranectl/campaign/commands/*.py",
            "cranectl/tools/benchmark/commands/tune.py",
        ),
        data=(
            "docs/reference/standings.md",
            "validation/benchmark/**/*",
            "cranectl/report/templates/*",
            "cranectl/tools/export/templates/*",
            "docs/how-to/benchmark.md",
        ),
    ),
    "drake": Set(modules=("tests/drake/*.py",)),
    "planning": Set(
        modules=("tests/planning/*.py", "tests/benchmark/test_nmpc_plans.py", "cranectl/cli/run.py"),
        data=("validation/benchmark/nmpc/*",),
    ),
    "processors": Set(
        modules=(*PACKAGE, "tests/**/*.py"),
        data=("docs/reference/metrics.md", "docs/reference/standings.md", *PACKAGE_DATA, "tests/**/*"),
        without=(
            *RESULTS,
            *(f"tests/{name}/**/*" for name in ("docs", "tools/thesis", "drake", "tools/live", "planning")),
        ),
    ),
    "viewer": Set(
        modules=("viewer/*.py", "cranectl/**/*.py"),
        data=("viewer/*", *PACKAGE_DATA, "docs/how-to/foxglove.md", "docs/pictures/foxglove-*.png"),
        without=RESULTS,
    ),
    "site": Set(modules=(*PACKAGE, "docs/**/*.py", "viewer/*.py"), data=("viewer/*", *PACKAGE_DATA, *PAGES)),
}


def main(given: list[str] | None = None) -> int:
    """Return the exit code of the command, or 0 where it does not have to run."""
    arguments = parsed_arguments(given)
    name = arguments.set
    files = files_of(SETS[name])
    now, then = digests_of(files), recorded().get(name, {})
    changed = changed_folders(now, then)
    if not changed and not arguments.always:
        print(f"{name}: unchanged since the last full pass, so its tests do not run", flush=True)
        return 0
    reason = (
        f"changed since the last full pass: {', '.join(changed) or 'nothing'}" if then else "never proven"
    )
    print(f"{name}: its tests run; {reason}", flush=True)
    if not arguments.always:
        return run(arguments.command, {})
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as listed:
        listed.write("\n".join(sorted(files)))
        listed.flush()
        code = run(arguments.command, {FILES: listed.name})
    return code or record(name, now)


def parsed_arguments(given: list[str] | None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("set", choices=SETS)
    parser.add_argument("--always", action="store_true", help="also where nothing changed; record a pass")
    own, command = split_at_dashes(sys.argv[1:] if given is None else given)
    arguments = parser.parse_args(own)
    if not command:
        parser.error("give a command after --")
    arguments.command = command
    return arguments


def split_at_dashes(given: list[str]) -> tuple[list[str], list[str]]:
    """Return the arguments before and after the first `--`."""
    where = given.index("--") if "--" in given else len(given)
    return given[:where], given[where + 1 :]


def record(name: str, before: dict[str, str]) -> int:
    """Record a set whose tests passed in full, if none of its files has changed since `before`."""
    if limits := [each for each in LIMITS if os.environ.get(each)]:
        print(f"{name}: not recorded: {' and '.join(limits)} limited its cases", flush=True)
        return 0
    if before != digests_of(files_of(SETS[name])):
        print(f"{name}: not recorded: sources changed while its tests ran; run it again", flush=True)
        return 1
    proven = {each: digests for each, digests in recorded().items() if each in SETS} | {name: before}
    (ROOT / RECORD).write_text(json.dumps(proven, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    print(f"{name}: recorded as passed: commit {RECORD}", flush=True)
    return 0


def recorded() -> dict[str, dict[str, str]]:
    """Return the digests of the last full pass by set and folder; empty where none is recorded."""
    path = ROOT / RECORD
    record: dict[str, dict[str, str]] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return record


def changed_folders(now: dict[str, str], then: dict[str, str]) -> list[str]:
    """Return the folders whose digest differs."""
    return sorted(folder for folder in {*now, *then} if now.get(folder) != then.get(folder))


def run(command: list[str], environment: dict[str, str]) -> int:
    """Run the command and return its exit code."""
    code = subprocess.run(command, env={**os.environ, **environment}, check=False).returncode
    return 128 - code if code < 0 else code


def digests_of(files: Iterable[str]) -> dict[str, str]:
    """Return a digest of the contents of these files for each of their folders, and the version of Python."""
    digests = {"Python": f"{sys.version_info.major}.{sys.version_info.minor}"}
    for folder, names in groupby(sorted(files, key=lambda name: (folder_of(name), name)), folder_of):
        digest = hashlib.sha256()
        for name in names:
            content = content_of(name)
            digest.update(f"{name}\0{len(content)}\0".encode() + content)
        digests[folder] = digest.hexdigest()[:DIGITS]
    return digests


def folder_of(name: str) -> str:
    """Return the folder of a file, or the file itself at the top."""
    return name.rpartition("/")[0] or name


def content_of(name: str) -> bytes:
    """Return what counts of a file: the syntax of Python, all of others."""
    content = (ROOT / name).read_bytes().replace(b"\r\n", b"\n")
    return Provenance.syntax_of(content) if name.endswith(".py") else content


def files_of(each: Set) -> set[str]:
    """Return all files of a set, by their names below ROOT."""
    without = matching(each.without)
    return with_imported(matching(each.modules) - without) | (matching(each.data + DATA) - without)


def matching(patterns: Iterable[str]) -> set[str]:
    """Return the files that a pattern matches, but no generated ones."""
    paths = (path for pattern in patterns for path in ROOT.glob(pattern))
    found = (path.relative_to(ROOT) for path in paths if path.is_file())
    return {path.as_posix() for path in found if GENERATED.isdisjoint(path.parts)}


def with_imported(names: set[str]) -> set[str]:
    """Return these Python files, all that they import, and the conftest.py of their folders."""
    waiting, seen = list(names), set(names)
    while waiting:
        name = waiting.pop()
        beside = {(parent / "conftest.py").as_posix() for parent in Path(name).parents}
        new = {each for each in beside if (ROOT / each).is_file()} | set(imported_files(name))
        waiting += new - seen
        seen |= new
    return seen


def imported_files(name: str) -> Iterator[str]:
    """Yield the files of the modules that a Python file imports or names, and of their packages."""
    for module in imported_modules(ast.parse((ROOT / name).read_bytes())):
        parts = module.split(".")
        for end in range(1, len(parts) + 1):
            path = "/".join(parts[:end])
            yield from (each for each in (f"{path}.py", f"{path}/__init__.py") if (ROOT / each).is_file())
        yield from (file.relative_to(ROOT).as_posix() for file in module_files(ROOT.joinpath(*parts)))


def imported_modules(tree: ast.AST) -> Iterator[str]:
    """Yield the dotted names that the source imports when it runs, ours only; some are names in modules."""
    nodes = [*running_nodes(tree)]
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.partition(".")[0] in PACKAGES)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in PACKAGES:
            for alias in node.names:
                home = home_of(node.module or "", alias.name)
                yield from read_off(home, alias.asname or alias.name, nodes) or [home]
        elif isinstance(node, ast.Constant) and (named := NAMED_MODULE.fullmatch(str(node.value))):
            yield named[1]


def read_off(module: str, name: str, nodes: list[ast.AST]) -> list[str]:
    """Return the homes of what is read off a folder's face as `name.NAME`; none of another module."""
    face = exported(ROOT.joinpath(*module.split(".")))
    attributes = (node for node in nodes if isinstance(node, ast.Attribute) and node.attr in face)
    return [home_of(module, node.attr) for node in attributes if ast.unparse(node.value) == name]


def home_of(module: str, name: str) -> str:
    """Return the dotted name of what is imported; faces of folders load their names when they are used."""
    home = exported(ROOT.joinpath(*module.split("."))).get(name)
    return ".".join(home.relative_to(ROOT).with_suffix("").parts) if home else f"{module}.{name}"


def running_nodes(node: ast.AST) -> Iterator[ast.AST]:
    """Yield all nodes but those that only a type checker reads."""
    yield node
    is_typing = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    for child in node.orelse if is_typing else ast.iter_child_nodes(node):
        yield from running_nodes(child)


if __name__ == "__main__":
    sys.exit(main())
