"""What docs/explanation/reading.md tells to read: ten stops, with the files and functions of each.

    python docs/reading.py      print the lines of code of each stop

The page names functions and classes, and no lines, so that it stays true when code moves. The site shows the
code below each entry.
"""

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).resolve().parent / "explanation" / "reading.md"
STOPS, MAX_LINES = 10, 1500
# An entry of a list, such as: - [`FILE`](PATH): `Loop.run`, `BLOCK`. What to look at.
# A file of which only the docstring is read has the name `__doc__`.
ENTRY = re.compile(
    r"^- \[`[^\]]+`\]\(([^)]+)\)(?::\s+(`[\w.]+`(?:,\s+`[\w.]+`)*))?\.(?: .*)?\n(?:  .*\n)*", re.M
)
Node = ast.ClassDef | ast.FunctionDef | ast.Assign | ast.AnnAssign


@dataclass(frozen=True)
class Entry:
    """A file to read, whole or only some of its definitions."""

    file: Path
    names: tuple[str, ...] = ()  # none: the whole file

    def parts(self) -> dict[str, range]:
        """Return the lines to read, by name: first the docstring of the file, then its definitions.

        `Class.method` is preceded by the docstring and the fields of its class. Raises KeyError for a name
        that the file does not define.
        """
        text = self.file.read_text(encoding="utf-8")
        if not self.names:
            return {"whole file": range(1, len(text.splitlines()) + 1)}
        tree = ast.parse(text)
        defined = dict(_definitions(tree))
        parts = {"docstring": _lines(tree.body[0])} if ast.get_docstring(tree) else {}
        for name in (name for name in self.names if name != "__doc__"):
            owner = defined.get(name.rpartition(".")[0])
            if isinstance(owner, ast.ClassDef):
                methods = [_lines(node).start for node in owner.body if isinstance(node, ast.FunctionDef)]
                parts.setdefault(owner.name, range(_lines(owner).start, min(methods)))
            parts[name] = _lines(defined[name])
        return parts

    def code(self, lines: range) -> str:
        """Return the text of some lines of the file."""
        text = self.file.read_text(encoding="utf-8").splitlines()
        return "\n".join(text[lines.start - 1 : lines.stop - 1]).rstrip()


def _definitions(tree: ast.Module | ast.ClassDef, prefix: str = "") -> Iterator[tuple[str, Node]]:
    """Yield each definition of a file by its name, methods as `Class.method`."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            yield prefix + node.name, node
        if isinstance(node, ast.ClassDef):
            yield from _definitions(node, f"{node.name}.")
        targets = node.targets if isinstance(node, ast.Assign) else []
        targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
        named = (target for target in targets if isinstance(target, ast.Name | ast.Attribute))
        yield from ((prefix + ast.unparse(target), node) for target in named)


def _lines(node: ast.stmt) -> range:
    decorators = node.decorator_list if isinstance(node, ast.ClassDef | ast.FunctionDef) else []
    first = min([node.lineno, *(decorator.lineno for decorator in decorators)])
    return range(first, (node.end_lineno or first) + 1)


def entry_of(match: re.Match[str], page: Path = PAGE) -> Entry:
    """Return the entry that `ENTRY` has found."""
    return Entry((page.parent / match[1]).resolve(), tuple(re.findall(r"`([\w.]+)`", match[2] or "")))


def read_stops(text: str, page: Path = PAGE) -> dict[str, list[Entry]]:
    """Return the entries of each numbered section of the page."""
    _, *sections = re.split(r"^## (?=\d)", text, flags=re.M)
    return {
        section.partition("\n")[0]: [entry_of(match, page) for match in ENTRY.finditer(section)]
        for section in sections
    }


def count_lines(stops: Mapping[str, list[Entry]]) -> dict[str, int]:
    """Return how many lines each stop adds to those that were read before."""
    counts, known = {}, set[tuple[Path, int]]()
    for title, entries in stops.items():
        lines = {(e.file, line) for e in entries for part in e.parts().values() for line in part}
        counts[title] = len(lines - known)
        known |= lines
    return counts


def with_code(text: str, page: Path = PAGE) -> str:
    """Return the page for the site: the code follows each entry, and opens at a click."""

    def shown(match: re.Match[str]) -> str:
        entry, blocks = entry_of(match, page), []
        for name, lines in entry.parts().items():
            code = entry.code(lines).replace("\n", "\n  ")
            language = {".py": "python"}.get(entry.file.suffix, "text")
            count = f"{len(lines)} line{'s' * (len(lines) > 1)}"
            summary = f"<summary><code>{name}</code>, {count}</summary>"
            blocks.append(f"\n  <details>{summary}\n\n  ~~~~{language}\n  {code}\n  ~~~~\n\n  </details>\n")
        return match[0] + "".join(blocks) + "\n"

    return ENTRY.sub(shown, text)


if __name__ == "__main__":
    counts = count_lines(read_stops(PAGE.read_text(encoding="utf-8")))
    for title, count in counts.items():
        print(f"{count:5} {title}")
    print(f"{sum(counts.values()):5} of at most {MAX_LINES}")
