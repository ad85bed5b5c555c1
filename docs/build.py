"""Build the site: the pages of docs/, and those that are made from data, in build/docs.

    python docs/build.py              into build/docs
    python docs/build.py DIRECTORY
    python docs/build.py --no-gallery     without running the examples

Pages are copied into another folder, DIRECTORY-source, and Sphinx reads them there. So Markdown in docs/
stays plain, and its links work on a forge too. Sections and their order are those of docs/index.md.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from cranectl.tools.benchmark.report.page import benchmark_page
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import BenchmarkTable
from docs import api_pages, reading
from validation.performance import page as performance
from validation.proofs import mutation_results as mutations

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
JUDGED = "validation/benchmark/literature.parquet"
BENCHMARK = "proofs/literature.html"
RENAMED = {
    "README.md": "index.md",
    "docs/index.md": "pages.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changes.md",
    "examples/harbour-crane/README.md": "how-to/harbour-crane.md",
    "examples/gymnasium/README.md": "how-to/gymnasium.md",
}
GALLERY = {"docs/gallery/README.rst": "examples/index.rst"}  # which sphinx-gallery writes
BUILT = {  # pages that only the site has, by section
    "Reference": [
        "- [Python API](reference/api.rst), [rooms of the core](reference/rooms/index.rst)",
        "- [options of all commands](reference/command-line.rst)",
    ],
    "Proofs": [
        "- [mutations](proofs/mutations.md): each term of the physics, and the test that notices its change",
        "- [performance](proofs/performance.md)",
        f"- <a href='../{BENCHMARK}'>the benchmark's judged table</a>",
    ],
}
LINK = re.compile(r"(\]\(|^\[[^\]]+\]: )(?!https?:|#|mailto:)([^)\s#]+)", re.MULTILINE)
PICTURE = re.compile(r"<img\b[^>]*>")
SECTION = re.compile(r"^\*\*(.+)\*\*\n\n((?:[-  ].*\n)+)", re.MULTILINE)


def read_sections(index: str) -> dict[str, str]:
    """Return the list of links of each section of docs/index.md, by its title."""
    sections = SECTION.findall(index)
    return {title: "\n".join([links.rstrip(), *BUILT.get(title, []), ""]) for title, links in sections}


def pages_of(links: str) -> list[str]:
    """Return the pages that a section's list links, in order, relative to docs/."""
    return list(dict.fromkeys(path for _, path in LINK.findall(links)))


def toctree(pages: list[str]) -> str:
    """Return the directive that puts pages into the site's menu without showing them on the page."""
    return "\n".join(["", "```{toctree}", ":hidden:", "", *pages, "```", ""])


def staged_path(path: Path) -> str:
    """Return where a file of the repository stands in the site, relative to its root."""
    name = path.relative_to(ROOT).as_posix()
    if name in RENAMED | GALLERY:
        return (RENAMED | GALLERY)[name]
    return name.removeprefix("docs/") if path.is_relative_to(DOCS) else f"files/{name}"


def move_links(text: str, old: Path, new: str, source: Path) -> str:
    """Return a page's text with the links it needs in the site. Copy linked files that are not pages."""

    def moved(match: re.Match[str]) -> str:
        target = (old.parent / match.group(2)).resolve()
        name = staged_path(target)
        if name.startswith("files/"):
            copy = source / name
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(target, copy)
        return match.group(1) + os.path.relpath(name, Path(new).parent)

    return LINK.sub(moved, text)


def write_data_pages(source: Path) -> None:
    """Write the pages of the proof by mutations, of performance and of the benchmark."""
    proofs = source / "proofs"
    proofs.mkdir(parents=True, exist_ok=True)
    texts = {
        "mutations.md": mutations.mutation_page(mutations.read_results(mutations.DATA)),
        "performance.md": performance.performance_page(*performance.read_results()),
    }
    for name, text in texts.items():
        (proofs / name).write_text(text, encoding="utf-8")
    command = f"cranectl benchmark report {JUDGED} --out literature.html"
    judged = benchmark_page(Benchmark.read("literature"), BenchmarkTable.read(ROOT / JUDGED), command)
    page = source / "extra" / BENCHMARK
    page.parent.mkdir(parents=True)
    judged.write(page)


def stage(source: Path) -> None:
    """Write all that Sphinx reads into an empty folder."""
    shutil.rmtree(source, ignore_errors=True)
    scripts = [path.name for path in DOCS.glob("*.py") if path.name != "conf.py"]
    shutil.copytree(DOCS, source, ignore=shutil.ignore_patterns("*.md", "__pycache__", *scripts))
    write_data_pages(source)
    rooms = source / "reference" / "rooms"
    rooms.mkdir()
    for name, text in api_pages.room_pages():
        (rooms / f"{name}.rst").write_text(text, encoding="utf-8")
    index = DOCS / "index.md"
    pages = [path for path in DOCS.rglob("*.md") if path != index] + [ROOT / name for name in RENAMED]
    for page in pages:
        new = staged_path(page)
        text = move_links(page.read_text(encoding="utf-8"), page, new, source)
        if page == reading.PAGE:
            text = reading.with_code(text, source / new)
        (source / new).write_text(text, encoding="utf-8")
    menu = []
    for title, links in read_sections(index.read_text(encoding="utf-8")).items():
        folder = title.lower().replace(" ", "-")
        inside = pages_of(move_links(links, index, "index.md", source))
        if len(inside) == 1:
            menu.append(f"{title} <{inside[0]}>")
            continue
        name = f"{folder}/index.md"
        (source / folder).mkdir(exist_ok=True)
        moved = move_links(links, index, name, source)
        (source / name).write_text(f"# {title}\n\n{moved}{toctree(pages_of(moved))}", encoding="utf-8")
        menu.append(name)
    with (source / "index.md").open("a", encoding="utf-8") as file:
        file.write(toctree([*menu, "contributing.md", "changes.md", "pages.md"]))


def undescribed_pictures(directory: Path) -> list[str]:
    """Return the pictures of all pages that have no description of at least three words.

    Sphinx-gallery takes the titles of a figure, or the name of its script if there is none. A thumbnail needs
    no description because its title stands below it.
    """
    found = []
    for page in sorted(directory.rglob("*.html")):
        for element in PICTURE.findall(page.read_text(encoding="utf-8")):
            attributes = dict(re.findall(r'(\w+)="([^"]*)"', element))
            source, words = attributes["src"], attributes.get("alt", "").split()
            if len(words) < 3 and not source.endswith("thumb.png"):
                found.append(f"{page.relative_to(directory).as_posix()}: {source}")
    return found


def build(directory: Path, gallery: bool = True) -> None:
    """Write the site into `directory`, with the examples of the gallery. A warning is an error."""
    source = directory.parent / f"{directory.name}-source"
    stage(source)
    shutil.rmtree(directory, ignore_errors=True)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    options = ["--fail-on-warning", "--keep-going", "--quiet", "--jobs", "auto"]
    options += ["-D", f"plot_gallery={int(gallery)}"]
    options += ["-D", f"release={project['version']}", "-D", f"html_title=cranectl {project['version']}"]
    # Examples call `cranectl`, as users do: that of this Python.
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    sphinx = [sys.executable, "-m", "sphinx", *options, source, directory]
    subprocess.run(sphinx, check=True, env={**os.environ, "PATH": path, "PYTHONPATH": str(DOCS)})
    if undescribed := undescribed_pictures(directory):
        what = "pictures without a description (alt text, or title of a figure):"
        sys.exit("\n".join([what, *undescribed]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("directory", nargs="?", type=Path, default=ROOT / "build" / "docs")
    parser.add_argument("--no-gallery", action="store_true", help="do not run the examples of the gallery")
    arguments = parser.parse_args()
    directory = arguments.directory.resolve()
    build(directory, gallery=not arguments.no_gallery)
    print(f"site: {directory / 'index.html'}")
