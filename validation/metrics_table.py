"""The table of docs/reference/metrics.md, from the table of metrics.

python validation/metrics_table.py            print it
python validation/metrics_table.py --write    and put it into the page
"""

import sys
from pathlib import Path

from cranectl.metrics.table import METRICS

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "metrics.md"
HEAD = "| metric | symbol | unit | meaning | definition | better |\n|---|---|---|---|---|---|\n"


def table() -> str:
    """One row a metric, in Markdown."""
    rows = []
    for metric in METRICS:
        name = f"`{metric.name}`{': ' if metric.parts else ''}{' '.join(metric.parts)}"
        cells = (name, metric.symbol, metric.unit, metric.meaning, metric.definition, metric.better)
        rows.append(" | ".join(cell.replace("|", r"\|") for cell in cells))
    return HEAD + "".join(f"| {row} |\n" for row in rows)


def page(text: str) -> str:
    """The page `text` with its table made anew."""
    before, head, rest = text.partition(HEAD)
    _, blank, after = rest.partition("\n\n")
    return before + table() + blank[1:] + after if head else text


if __name__ == "__main__":
    print(table(), end="")
    if "--write" in sys.argv[1:]:
        PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
