"""Write and read results of tuning: a controller's numbers in TOML, the points of its search in Parquet."""

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cranectl.controllers import ALL_CONTROLLERS
from cranectl.support import TOML, File, FileKind, InputError, Provenance, Tree
from cranectl.tools.benchmark.declared import assignments, variables_of
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.tuning import Point, Tuned

DEFAULT = "literature"  # the default benchmark
TUNING = FileKind("result of tuning", rb"law = ")


class TunedResult:
    """The stored result of tuning a controller: its numbers in TOML, the points of its search in Parquet."""

    @staticmethod
    def files(directory: Path, controller: str) -> tuple[Path, Path]:
        """Return the files for a controller's numbers and points; raise InputError if none can be written."""
        files = directory / f"{controller}.toml", directory / f"{controller}.parquet"
        for path, kind in zip(files, (TUNING, FileKind.PARQUET), strict=True):
            kind.check_place(path, option="--out")
        return files

    @staticmethod
    def table(tuned: Tuned, benchmark: Benchmark, rules: str) -> dict[str, Any]:
        """Return the content of the file of tuned numbers, which hold on the laboratory rig."""
        points = tuned.best_points
        return {
            "law": tuned.controller,
            "code": code_of(tuned.controller),
            "benchmark": benchmark.name,
            "rules": rules,
            "seed": benchmark.tuning.seed,
            "budget_runs": tuned.evaluations * tuned.runs_each,
            "runs": len(tuned.points) * tuned.runs_each,
            "chosen": tuned.chosen,
            "cost": {name: point.cost for name, point in points.items()},
            "failed": {name: point.failed for name, point in points.items()},
            "validation": {
                "cost": {name: point.cost for name, point in tuned.validated.items()},
                "failed": {name: point.failed for name, point in tuned.validated.items()},
            },
            "parameters": tuned.parameters,
        }

    @staticmethod
    def search(controller: str, rules: str) -> str:
        """Return a digest of all that decides the points of a search: rules, controller, sources."""
        text = " ".join([rules, controller, code_of(controller) or "", Provenance.fingerprints()["sources"]])
        return hashlib.sha256(text.encode()).hexdigest()

    @staticmethod
    def unfinished_file(directory: Path, controller: str) -> Path:
        """Return the file that keeps the points of a search until it ends."""
        return directory / f"{controller}.unfinished.parquet"

    @staticmethod
    def write_points(
        path: Path, keys: Sequence[str], points: Sequence[Point], about: Mapping[str, str]
    ) -> None:
        """Write a row for each candidate: its index, values of the settings `keys`, cost, failures.

        The first row is the untuned controller. The metadata are `about`. Raises InputError if writing fails.
        """
        import pyarrow
        from pyarrow import parquet

        columns = {
            "evaluation": list(range(len(points))),
            **{key: [point.values[k] for point in points] for k, key in enumerate(keys)},
            "cost": [point.cost for point in points],
            "failed_share": [point.failed for point in points],
        }
        with File(path).writing(), File(path).replacing() as unfinished:
            parquet.write_table(pyarrow.table(columns, metadata=dict(about)), unfinished, compression="zstd")

    @staticmethod
    def read_unfinished(path: Path, search: str) -> list[Point]:
        """Return the points in `path` of the interrupted search with the digest `search`, or none."""
        from pyarrow import ArrowException, parquet

        if not path.is_file():
            return []
        try:
            table = parquet.read_table(path)
            if (table.schema.metadata or {}).get(b"search") != search.encode():
                return []
            _, *numbers, cost, failed = (column.to_pylist() for column in table.columns)
        except (ArrowException, ValueError):  # damaged, so the search begins anew
            return []
        return [Point(*row) for row in zip(zip(*numbers, strict=True), cost, failed, strict=True)]

    @staticmethod
    def write(tuned: Tuned, table: Mapping[str, Any], files: tuple[Path, Path]) -> None:
        """Write the two files of tuning; `table` is from `tuned_table`, and `files` from `tuned_files`.

        Each file is written completely or not at all. Raises InputError if writing fails.
        """
        numbers, points = files
        keys = [variable.key for variable in tuned.variables]
        TunedResult.write_points(
            points, keys, tuned.points, {name: table[name] for name in ("law", "benchmark", "rules")}
        )
        with File(numbers).writing():
            File(numbers).write_text(TOML.text(table))

    @staticmethod
    def settings(
        directory: Path, rules: str, controller: str, length: float, benchmark: str = DEFAULT
    ) -> list[str]:
        """Return settings `key=value` of a tuned controller for a crane of relative size `length`.

        The size is relative to the laboratory rig. Raises InputError as `tuned_facts` does.
        """
        numbers = TunedResult.facts(directory, rules, controller, benchmark)["numbers"]
        return assignments(variables_of(controller), [value for _, value in numbers.values()], length)

    @staticmethod
    def facts(directory: Path, rules: str, controller: str, benchmark: str = DEFAULT) -> dict[str, Any]:
        """Return `cost`, `failed` share and `numbers` of a tuned controller from its file in `directory`.

        `cost` and `failed` have three values: untuned, with half the budget, and with the whole budget, and
        so has `validation`. `chosen` names one of them. `numbers` has an untuned and a chosen value by
        setting. `benchmark` is the name or path that the user gave. Raises InputError if the file does not
        exist, or if controller or rules have changed since the tuning.
        """
        path = directory / f"{controller}.toml"
        option = [] if benchmark == DEFAULT else ["--benchmark", benchmark]
        command = ["cranectl", "tune", ALL_CONTROLLERS.argument(controller), *option, "--out", str(directory)]
        tune_again = shlex.join(command)
        if not path.is_file():
            raise InputError(
                f"{controller} is not tuned: {path} is not a file", remedy=f"tune it: {tune_again}"
            )
        table = TOML.read(path)
        variables, values = variables_of(controller), dict(Tree(table.get("parameters", {})).leaves())
        has_same_keys = values.keys() == {variable.key for variable in variables}
        if not _is_current(table, controller) or not has_same_keys:
            raise InputError(
                f"{path} holds the numbers of another version of {controller}",
                allowed="numbers that were found for the present controller",
                remedy=f"tune it again: {tune_again}",
            )
        if table.get("rules") != rules:
            raise InputError(
                f"{path} holds numbers that were found by the rules {table.get('rules')}, not {rules}",
                allowed="numbers that were found by the present rules of the benchmark",
                remedy=f"tune it again: {tune_again}",
            )
        try:
            numbers = {variable.key: [variable.start, float(values[variable.key])] for variable in variables}
            kept = ("runs", "cost", "failed", "chosen", "validation")
            return {**{name: table[name] for name in kept}, "numbers": numbers}
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"{path} is damaged: {type(error).__name__} {error}",
                allowed="a file as 'cranectl tune' has written it",
                remedy=f"tune it again: {tune_again}",
            ) from None


def code_of(controller: str) -> str | None:
    """Return the digest of the code of a controller from a file, or None for one of the package."""
    registered = ALL_CONTROLLERS.opened.registered
    return registered[controller].code or None if controller in registered else None


def _is_current(table: Mapping[str, Any], controller: str) -> bool:
    """Return True if the numbers in `table` were found for the present code of `controller`."""
    if "sha256" not in table:
        return bool(table.get("code") == code_of(controller))
    registered = ALL_CONTROLLERS.opened.registered
    origin = registered[controller].origin if controller in registered else None
    return bool(table["sha256"] == (origin.sha256 if origin else None))
