"""Write the pages that are made from data: the benchmark, the proof by mutations, performance.

    python docs/build.py              into build/docs
    python docs/build.py DIRECTORY

Their data are validation/benchmark/literature.parquet, validation/proofs/mutations.json and
validation/performance/performance.json.
"""

import argparse
from pathlib import Path

from cranectl.campaign.benchmark.settings import read_benchmark
from cranectl.campaign.benchmark.table import read_table
from cranectl.report.benchmark.page import benchmark_page
from cranectl.report.page import write_page
from validation.performance import page as performance
from validation.proofs import mutation_results as mutations

ROOT = Path(__file__).resolve().parents[1]
JUDGED = "validation/benchmark/literature.parquet"


def build(directory: Path) -> None:
    """Write all pages into `directory`."""
    directory.mkdir(parents=True, exist_ok=True)
    pages = {
        "mutations.md": mutations.mutation_page(mutations.read_results(mutations.DATA)),
        "performance.md": performance.performance_page(*performance.read_results()),
    }
    for name, text in pages.items():
        (directory / name).write_text(text, encoding="utf-8")
    remade_by = f"cranectl benchmark report {JUDGED} --out literature.html"
    judged = benchmark_page(read_benchmark("literature"), read_table(ROOT / JUDGED), remade_by)
    write_page(judged, directory / "literature.html")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("directory", nargs="?", type=Path, default=ROOT / "build" / "docs")
    place = parser.parse_args().directory
    build(place)
    print(f"pages: {place}")
