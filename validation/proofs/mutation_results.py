"""Write and read mutations.json, the results of `mutations.py`, and return them as a page.

A row of the file is a term: its line, its text, and for each kind of mutant a test that failed, as an
index into the list of tests. It is null if the kind was not tried, and "survived" if no test failed.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

DATA = Path(__file__).with_name("mutations.json")
KINDS = ("flipped", "dropped", "x 1.01", "next index")
SURVIVED = "survived"

HEAD = """# Mutation proof

This page shows that the tests notice every wrong term of the physics.
`validation/proofs/mutations.py` changes one term at a time: it flips the sign, drops the term, or
makes it 1 % larger. Elements in the limits of planned motions also get the next index. A cell names
a test that fails. `make docs` writes the page.

The terms are those of:

- the equations of motion, the flat map and the linearising law
- the tracker, other controllers, and the observer's correction
- the drive model, and the forces that act on the load
- the elastic crane, and the crane in MuJoCo and Drake
- the limits of planned motions

"""
NOT_TRIED = dict.fromkeys(KINDS, "is squared") | {"next index": "no index"}


class Row(NamedTuple):
    """One term of a function."""

    line: int
    term: str
    tests: tuple[str | None, ...]  # by kind: a test that failed, SURVIVED, or None if not tried


Results = Mapping[str, Sequence[Row]]  # by function


def read_results(path: Path) -> Results:
    """Read a file of `write_results`."""
    content = json.loads(path.read_text(encoding="utf-8"))
    names = {None: None, SURVIVED: SURVIVED, **dict(enumerate(content["tests"]))}
    return {
        function: [Row(line, term, tuple(names[cell] for cell in cells)) for line, term, *cells in rows]
        for function, rows in content["functions"].items()
    }


def write_results(results: Results, path: Path) -> None:
    """Write the file, with one line for each term."""
    cells = [cell for rows in results.values() for row in rows for cell in row.tests]
    tests = dict.fromkeys(cell for cell in cells if cell not in (None, SURVIVED))
    codes: dict[str | None, int | str | None] = {None: None, SURVIVED: SURVIVED}
    codes |= {test: index for index, test in enumerate(tests)}
    functions = [
        f"{json.dumps(function)}: {_lines((row.line, row.term, *map(codes.get, row.tests)) for row in rows)}"
        for function, rows in results.items()
    ]
    text = ",\n".join(functions)
    path.write_text(
        f'{{"kinds": {json.dumps(KINDS)},\n"tests": {_lines(tests)},\n"functions": {{\n{text}\n}}}}\n',
        encoding="utf-8",
    )


def _lines(values: Iterable[object]) -> str:
    """Return a list as JSON, with one line for each element."""
    rows = (json.dumps(value, ensure_ascii=False, separators=(",", ":")) for value in values)
    return "[\n{}\n]".format(",\n".join(rows))


def counts(results: Results) -> dict[str, int]:
    """Return the number of mutants of each function."""
    return {
        function: sum(cell is not None for row in rows for cell in row.tests)
        for function, rows in results.items()
    }


def survivors(results: Results) -> int:
    """Return the number of mutants for which no test failed."""
    return sum(row.tests.count(SURVIVED) for rows in results.values() for row in rows)


def mutation_page(results: Results) -> str:
    """Return the page in Markdown: sections are functions, rows are terms, columns are kinds of mutants."""
    tried, survived = sum(counts(results).values()), survivors(results)
    summary = f"**{tried} mutants, {tried - survived} caught, {survived} survived.**\n"
    return HEAD + "\n".join([summary, *(_section(*item) for item in results.items())])


def _section(function: str, rows: Sequence[Row]) -> str:
    kinds = KINDS if any(len(row.tests) == len(KINDS) for row in rows) else KINDS[:-1]
    headings = ("line", "term", *(kind.replace("x", "×") if "1.01" in kind else kind for kind in kinds))
    lines = [f"## `{function}`", "", f"| {' | '.join(headings)} |", f"|{'---|' * len(headings)}"]
    for row in rows:
        cells = dict(zip(KINDS, row.tests, strict=False))
        shown = (_cell(kind, cells.get(kind)) for kind in kinds)
        lines.append(f"| {row.line} | `{row.term}` | {' | '.join(shown)} |")
    return "\n".join(lines) + "\n"


def _cell(kind: str, test: str | None) -> str:
    if test is None:
        return NOT_TRIED[kind]
    return f"**{test}**" if test == SURVIVED else f"`{test}`"
