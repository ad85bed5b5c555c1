"""Results of `mutations.py`: the file that keeps them, mutations.json, and the page that shows them.

In the file a row is a term: its line, its text, and by kind of mutant the test that failed first, as an index
into the list of tests. A kind that was not tried is null, one that no test noticed is "survived".
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

DATA = Path(__file__).with_name("mutations.json")
KINDS = ("flipped", "dropped", "x 1.01", "next index")
SURVIVED = "survived"

HEAD = """# Mutation proof

Measured by `validation/proofs/mutations.py`, written by `make docs`. Every term of the equations of motion,
the flat map, the linearising law, the tracker, the observer's correction, the forces that act on the load,
the drive model, the elastic crane, the crane in Drake and the limits of planned motions is flipped in sign,
dropped, and made 1 % larger, one at a time; of limits an index is moved on too. In the cells is the first
test that fails.

"""
NOT_TRIED = dict.fromkeys(KINDS, "enters squared") | {"next index": "no index"}


class Row(NamedTuple):
    """One term of a function."""

    line: int
    term: str
    tests: tuple[str | None, ...]  # by kind the test that failed first, SURVIVED, or None where not tried


Results = Mapping[str, Sequence[Row]]  # by function


def read_results(path: Path) -> Results:
    """Return what `write_results` has written."""
    told = json.loads(path.read_text(encoding="utf-8"))
    names = {None: None, SURVIVED: SURVIVED, **dict(enumerate(told["tests"]))}
    return {
        function: [Row(line, term, tuple(names[cell] for cell in cells)) for line, term, *cells in rows]
        for function, rows in told["functions"].items()
    }


def write_results(results: Results, path: Path) -> None:
    """Write the file, a row a line."""
    cells = [cell for rows in results.values() for row in rows for cell in row.tests]
    tests = dict.fromkeys(cell for cell in cells if cell not in (None, SURVIVED))
    places: dict[str | None, int | str | None] = {None: None, SURVIVED: SURVIVED}
    places |= {test: place for place, test in enumerate(tests)}
    functions = [
        f"{json.dumps(function)}: {_lines((row.line, row.term, *map(places.get, row.tests)) for row in rows)}"
        for function, rows in results.items()
    ]
    text = ",\n".join(functions)
    path.write_text(
        f'{{"kinds": {json.dumps(KINDS)},\n"tests": {_lines(tests)},\n"functions": {{\n{text}\n}}}}\n',
        encoding="utf-8",
    )


def _lines(values: Iterable[object]) -> str:
    """Return a list as JSON, an element a line."""
    rows = (json.dumps(each, ensure_ascii=False, separators=(",", ":")) for each in values)
    return "[\n{}\n]".format(",\n".join(rows))


def counts(results: Results) -> dict[str, int]:
    """Return the number of mutants of each function."""
    return {
        function: sum(cell is not None for row in rows for cell in row.tests)
        for function, rows in results.items()
    }


def survivors(results: Results) -> int:
    """Return the number of mutants that no test noticed."""
    return sum(row.tests.count(SURVIVED) for rows in results.values() for row in rows)


def mutation_page(results: Results) -> str:
    """Return the page in Markdown: a section a function, a row a term, a column a kind."""
    tried, survived = sum(counts(results).values()), survivors(results)
    summary = f"**{tried} mutants, {tried - survived} caught, {survived} survived.**\n"
    return HEAD + "\n".join([summary, *(_section(*each) for each in results.items())])


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
