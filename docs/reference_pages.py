"""The tables of docs/reference/ and validation/schemas/, from the tables and classes that the package uses.

python docs/reference_pages.py            say which differ
python docs/reference_pages.py --write    and write them

A page is what people wrote, and between two comments what is written here.
"""

import functools
import json
import math
import re
import sys
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from google.protobuf import descriptor_pb2

from cranectl.campaign.settings import CampaignSettings
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.list import DOCUMENTS
from cranectl.cli.main import COMMANDS
from cranectl.cli.schemas import json_schema
from cranectl.controllers.registry import ALL_CONTROLLERS, FLAT_FAMILY, WHERE
from cranectl.log.messages import streams
from cranectl.metrics.table import METRICS
from cranectl.planning import load_scenario
from cranectl.report.table import Cell
from cranectl.report.theme import Chart
from cranectl.scenario import Scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import Run, simulate_run
from cranectl.tools.benchmark.ranking import Judged
from cranectl.tools.benchmark.report.opening import caveats, conclusions, tuning_tables
from cranectl.tools.benchmark.report.page import judged_divisions
from cranectl.tools.benchmark.report.pictures import KEY, set_pictures
from cranectl.tools.benchmark.report.sets import NAMED, TITLES, finite, named
from cranectl.tools.benchmark.settings import Benchmark, benchmark_file
from cranectl.tools.benchmark.table import BenchmarkTable
from docs.standings import statements

ROOT = Path(__file__).resolve().parent.parent
DIRECTORY = ROOT / "docs" / "reference"
BEGIN = "<!-- written by `python docs/reference_pages.py --write` -->\n"
END = "<!-- end -->\n"
BOUNDS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
PLANTS = ("analytic", "mujoco")  # of the log that is described
KINDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}


def table(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    lines = [list(headings), *([cell.replace("|", r"\|") for cell in row] for row in rows)]
    texts = [f"| {' | '.join(line)} |\n" for line in lines]
    return "".join([texts[0], "|---" * len(lines[0]), "|\n", *texts[1:]])


def commands() -> str:
    """Return a table of all commands by group, as `cranectl --help` lists them."""
    rows = [(group, f"`{name}`", text) for group, of in COMMANDS.items() for name, text in of.items()]
    return table(("group", "command", "what it does"), rows)


def metrics() -> str:
    """Return the table of metrics."""
    rows = []
    for metric in METRICS:
        name = f"`{metric.name}`{': ' if metric.parts else ''}{' '.join(metric.parts)}"
        rows.append((name, metric.symbol, metric.unit, metric.meaning, metric.definition, metric.better))
    return table(("metric", "symbol", "unit", "meaning", "definition", "better"), rows)


def exit_codes() -> str:
    """Return the table of exit codes."""
    return table(("code", "meaning"), ((str(code), code.meaning) for code in ExitCode))


@functools.cache
def recorded_run(plant: str, controller: str) -> Run:
    """Return a run that records all that it can, with a signal path between plant and controller."""
    overrides = ["duration=0.01", "disturbances=[]", "effects.sensing={}"]
    scenario = load_scenario("fixed-position", overrides=overrides)
    return simulate_run(scenario, plant=plant, controller=controller, drive="velocity")


def signals() -> str:
    """Return a section for each group of signals: the flat family's, then those of others."""
    groups: dict[str, SignalGroup] = {}
    for controller in FLAT_FAMILY:
        for group in recorded_run("analytic", controller).groups:
            title = f"`/PLANT/{group.name}`"
            groups[title] = max(groups.get(title, group), group, key=len)
    for controller in WHERE:
        for group in recorded_run("analytic", controller).groups:
            title = f"`/PLANT/{group.name}`"
            if not {*group.names} <= {*groups[title].names}:
                groups[f"{title} of {controller}"] = group
    sections = []
    for title, group in {**groups, "`/reference/load`": SignalGroup.REFERENCE}.items():
        rows = ((f"`{each.name}`", each.symbol, each.unit, each.description) for each in group.signals)
        text = table(("signal", "symbol", "unit", "meaning"), rows)
        sections.append(f"## {title}\n\n{group.description[0].upper()}{group.description[1:]}.\n\n{text}")
    return "\n".join(sections)


def topics() -> str:
    """Return the table of what a log of two plants holds."""
    rows = {}
    for stream in streams([recorded_run(plant, "lqr+hinf") for plant in PLANTS]):
        topic = re.sub(f"^/({'|'.join(PLANTS)})/", "/PLANT/", stream.topic)
        fields = ", ".join(_fields(stream.schema, stream.schema_name))
        rows[topic] = (f"`{topic}`", f"`{stream.schema_name}`", fields)
    return table(("topic", "message", "fields"), (rows[topic] for topic in sorted(rows)))


def _fields(schema: bytes, name: str) -> list[str]:
    """Return the fields of a message type; Foxglove documents those that are not cranectl's."""
    files = descriptor_pb2.FileDescriptorSet.FromString(schema).file
    types = {f"{file.package}.{message.name}": message for file in files for message in file.message_type}
    return [f"`{field.name}`" for field in types[name].field]


NO_BRACKETS = str.maketrans("", "", "[]")


def settings() -> str:
    """Return a section for each table of scenario, controllers, campaign and benchmark."""
    models = (Scenario, CampaignSettings, Benchmark)
    scenario, campaign, benchmark = (_sections(model.model_json_schema()) for model in models)
    controllers = map(_controller_section, WHERE)
    files = ("## Campaign\n", *campaign, "## Benchmark\n", *benchmark)
    return "\n".join(("## Scenario\n", *scenario, *controllers, *files))


@functools.cache
def _divisions() -> list[Judged]:
    """Return the divisions of the shipped table."""
    file = benchmark_file("literature")
    return judged_divisions(
        Benchmark.read("literature"), BenchmarkTable.read(file.parent / "literature.parquet")
    )


def standings() -> str:
    """Return pictures, sentences and caveats of the shipped table, what tuning did, rankings, and reasons."""
    what = "failures against unsettled time on"
    drawn = (f"![{what} {Path(name).stem[10:]}](../pictures/{name})" for name in pictures())
    tuning = next(tuning_tables(_divisions()))
    rows = ([_marked(cell) for cell in row] for row in tuning.rows)
    parts = [
        "\n".join(drawn),
        f"Tuned, on the sets {', '.join(_divisions()[0].ranked_sets)} in this order. {KEY}",
        "## What came out",
        *conclusions(_divisions()),
        "## Read this before the tables",
        "\n".join(caveats(_divisions())),
        "## Before and after tuning",
        f"{tuning.title}. Bold: more runs fail, and the intervals of 95 % do not overlap. {tuning.note}",
        table([heading.replace("\n", " ") for heading in tuning.headings], rows),
    ]
    parts += [*map(_ranking, _divisions()), *statements(_divisions())]
    wrapped = (part if part[0] in "|!#" else _wrap(part) for part in parts)
    return "\n\n".join(text.rstrip() for text in wrapped)


def _ranking(judged: Judged) -> str:
    """Return the ranking of a division on all of its sets; a star marks an undominated controller."""
    numbers: dict[str, list[str]] = {name: [] for name in judged.best_first}
    for crane_set in judged.ranked_sets:
        for standing in judged.ranking(crane_set):
            shares = f"{100.0 * standing.failed:.1f} / {100.0 * standing.unsettled:.1f}"
            numbers[standing.controller].append(f"{shares} / {finite(standing.effort, '.2f', 'fails')}")
    rows = []
    for name, cells in numbers.items():
        place = judged.fronts_with(name)
        shown, information = (cell.text for cell in named(judged, name))
        rows.append((f"★ {shown}" if place.startswith("all") else shown, information, place, *cells))
    headings = (*NAMED, "undominated on", *judged.ranked_sets)
    return f"## {TITLES[judged.division]}\n\n{table(headings, rows)}"


def _marked(cell: Cell) -> str:
    return f"**{cell.text}**" if cell.mark == "bad" else cell.text


def _wrap(text: str) -> str:
    """Return lines of at most 100 characters; those of a numbered list are indented."""
    lines = text.splitlines()
    indent = "   " if len(lines) > 1 else "  " if text.startswith("- ") else ""
    return "\n".join(
        textwrap.fill(line, 100, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False)
        for line in lines
    )


def pictures() -> dict[str, str]:
    """Return the pictures of the page of standings as SVG, by file."""
    tuned = _divisions()[0]
    figures = zip(tuned.ranked_sets, set_pictures(tuned), strict=True)
    return {f"standings-{name}.svg": Chart.standalone_svg(figure.svg) for name, figure in figures}


def _controller_section(name: str) -> str:
    controller = ALL_CONTROLLERS[name]
    rows = []
    for each in controller.parameters:
        bounds = {"minimum": each.lowest, "maximum": each.highest}
        finite_bounds = {word: bound for word, bound in bounds.items() if math.isfinite(bound)}
        kind = {"enum": each.choices} if each.choices else {"type": "number", **finite_bounds}
        meaning = f"{each.description} [{each.unit}]" if each.unit else each.description
        rows.append((f"`{each.name}`", _text(each.default), _allowed(kind), meaning))
    text = table(("key", "default", "allowed", "meaning"), rows)
    return f"### `[controller.{name}]`\n\n{controller.title}.\n\n{text}"


def _sections(schema: dict[str, Any]) -> Iterator[str]:
    """Yield the tables of settings that a JSON Schema has, in the order of its keys."""
    waiting = [("", schema)]
    while waiting:
        path, node = waiting.pop(0)
        rows, inner = [], []
        for key, value in node["properties"].items():
            kind = _not_null(value)
            title, alternatives = _tables(f"{path}.{key}".strip(".").translate(NO_BRACKETS), kind)
            below = [entry["$ref"] for entry in alternatives if "$ref" in entry]
            inner += [(title, schema["$defs"][reference.rpartition("/")[2]]) for reference in below]
            if len(below) < len(alternatives):
                default = "" if key in node.get("required", ()) else _text(value.get("default")) or "absent"
                rows.append((f"`{key}`", default, _allowed(kind), value.get("description", "")))
        waiting = inner + waiting
        title = f"### `[{path}]`\n\n" if path else ""
        text = table(("key", "default", "allowed", "meaning"), rows) if rows else ""
        yield f"{title}{node.get('description', '')}\n\n{text}"


def _not_null(value: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a key that may be absent, for where it is present."""
    return next((entry for entry in value.get("anyOf", ()) if entry.get("type") != "null"), value)


def _tables(path: str, kind: dict[str, Any]) -> tuple[str, list[dict[str, Any]]]:
    """Return the heading of the tables that stand for a key, and their kinds."""
    if isinstance(kind.get("additionalProperties"), dict):
        path, kind = f"{path}.NAME", kind["additionalProperties"]
    elif "items" in kind:
        path, kind = f"[{path}]", kind["items"]
    return path, kind.get("oneOf", [kind])


def _text(value: Any) -> str:
    """Return a value in TOML's form, numbers to six digits."""
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, float):
        return f"{value:g}"
    return "" if value is None else json.dumps(value, ensure_ascii=False)


def _allowed(kind: dict[str, Any]) -> str:
    if values := kind.get("enum") or ([kind["const"]] if "const" in kind else []):
        return ", ".join(f"`{value}`" for value in values)
    if elements := kind.get("prefixItems"):
        return f"{len(elements)} of: {_allowed(elements[0])}"
    if "items" in kind:
        return f"list of: {_allowed(kind['items'])}"
    if entries := kind.get("anyOf") or kind.get("oneOf"):
        return " or ".join(_allowed(entry) for entry in entries if entry.get("type") != "null")
    if "$ref" in kind or kind["type"] == "object":
        return "table"
    bounds = [f"{sign} {_text(float(kind[word]))}" for word, sign in BOUNDS.items() if word in kind]
    return " ".join([KINDS[kind["type"]], ", ".join(bounds)]).rstrip()


PAGES = {
    page.__name__.replace("_", "-"): page
    for page in (commands, exit_codes, metrics, settings, signals, standings, topics)
}


def written_anew(name: str, text: str) -> str:
    """Replace the generated part of the page `text`; raise ValueError if it has no place for it."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"{name}.md lacks {BEGIN}{END}")
    return f"{before}{BEGIN}\n{PAGES[name]()}\n{END}{after}"


def generated_files() -> Iterator[tuple[Path, str]]:
    """Yield each file that is generated, or has a generated part, with what it must contain."""
    for document in DOCUMENTS:
        schema = json.dumps(json_schema(document), indent=1, ensure_ascii=False) + "\n"
        yield ROOT / "validation" / "schemas" / f"{document}.json", schema
    for name in PAGES:
        path = DIRECTORY / f"{name}.md"
        yield path, written_anew(name, path.read_text(encoding="utf-8"))
    for name, picture in pictures().items():
        yield ROOT / "docs" / "pictures" / name, picture


if __name__ == "__main__":
    for path, new in generated_files():
        if not path.exists() or path.read_text(encoding="utf-8") != new:
            print(f"{path.relative_to(ROOT).as_posix()} differs")
            if "--write" in sys.argv[1:]:
                path.write_text(new, encoding="utf-8")
