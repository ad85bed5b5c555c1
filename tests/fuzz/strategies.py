"""Hypothesis strategies for odd and hostile input: documents, bytes and command lines."""

import copy
import json
import math
from collections.abc import Iterator
from typing import Any

import click
from hypothesis import strategies as st

from cranectl.cli.main import cli

HOSTILE = ["", "-", "[red]x[/]", "[/]", "\x1b[2J\x07", "a\nfound: forged", "a\r", "\0", "\u202e", "\udcff"]
HOSTILE += ["é" * 300, "a" * 100_000, ":smile:", "{x}", "%s", "..", "nan", "[[" * 20, "\u2028"]
HOSTILE += ["\ufeff", "\x9b"]
TEXTS = st.one_of(st.sampled_from(HOSTILE), st.text(max_size=12))
NUMBERS = st.one_of(
    st.sampled_from(
        [0, -1, 1, 2, 0.5, -0.0, 1e-9, 1e9, 1e300, math.nan, math.inf, -math.inf, 2**63, 10**400]
    ),
    st.floats(),
    st.integers(),
)
LENGTHS = st.sampled_from([1, 33, 40, 2_000, 50_000])


class Raw(str):
    """Text that is written into TOML unchanged, and into JSON as a string."""

    __slots__ = ()


def _extreme_literal(kind: int, length: int) -> Raw:
    return Raw(
        [
            "[" * length,
            "[" * length + "]" * length,
            "{a=" * length + "1" + "}" * length,
            "{" + "a." * length + "a = 1}",
            "9" * length,
            "0x" + "f" * length,
            "1e" + "9" * min(length, 400),
            '"""' + "\\" * length,
            "1979-05-27T07:32:00Z",
            '"\\ud800"',
        ][kind]
    )


RAW = st.builds(_extreme_literal, st.integers(0, 9), LENGTHS)
PLAIN = st.one_of(NUMBERS, TEXTS, st.booleans(), st.none())
VALUES = st.recursive(
    PLAIN, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=3), max_leaves=6
)


def _entries(node: Any) -> Iterator[tuple[Any, Any]]:
    """Yield each container of a document, with each of its keys or indices."""
    for key in list(node) if isinstance(node, dict) else range(len(node)):
        yield node, key
        if isinstance(node[key], dict | list):
            yield from _entries(node[key])


@st.composite
def changed(draw: st.DrawFn, document: Any, values: st.SearchStrategy[Any] = VALUES) -> Any:
    """Replace, scale, remove, repeat or add one to three values of a document."""
    document = copy.deepcopy(document)
    for _ in range(draw(st.integers(1, 3))):
        entries = list(_entries(document))
        if not entries:
            return document
        node, key = entries[draw(st.integers(0, len(entries) - 1))]
        change = draw(st.sampled_from(["replace", "replace", "scale", "remove", "more"]))
        if change == "scale" and type(node[key]) in (int, float) and abs(node[key]) < 1e300:
            node[key] *= draw(st.sampled_from([-1, 0.5, 2, 1000, 1.001]))
        elif change == "remove":
            del node[key]
        elif change == "more" and isinstance(node, list):
            node.extend([node[key]] * draw(st.sampled_from([1, 2, 100])))
        elif change == "more":
            node[draw(TEXTS)] = draw(values)
        else:
            node[key] = draw(values)
    return document


def toml(value: Any) -> str:
    """Write a value as TOML on one line; None gives an empty text."""
    if isinstance(value, Raw):
        return value
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, str | bool) or value is None:
        return json.dumps(value, ensure_ascii=False) if value is not None else ""
    return repr(value)


TOML_TOKENS = [*"[]{}.='\"\n\r\0\x1b,\\ a1#", '"""', "rig", "e9", "name", "true", "\ud800", "\ufeff"]
RANDOM_TOML = st.lists(
    st.tuples(st.sampled_from(TOML_TOKENS), LENGTHS | st.just(1) | st.just(1)), max_size=12
).map(lambda pieces: "".join(token * times for token, times in pieces))


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """Replace, remove or repeat one to four pieces of a file, or cut it off."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(content)))
        stop = min(start + draw(st.sampled_from([0, 1, 4, 8, 100, 10_000])), len(content))
        change = draw(st.sampled_from(["replace", "replace", "remove", "repeat", "cut"]))
        middle = {"replace": b"", "remove": b"", "repeat": content[start:stop] * 2, "cut": b""}[change]
        if change == "replace":
            middle = draw(st.binary(min_size=1, max_size=8))
            stop = min(start + len(middle), len(content))
        content = content[:start] + middle + (b"" if change == "cut" else content[stop:])
    return content


@st.composite
def toml_files(draw: st.DrawFn, documents: list[Any]) -> bytes:
    """Draw a TOML file with odd values, with damaged bytes, or of random tokens."""
    if draw(st.integers(0, 5)) == 0:
        return draw(RANDOM_TOML).encode(errors="surrogatepass")
    table = draw(changed(draw(st.sampled_from(documents)), st.one_of(VALUES, RAW)))
    text = "\n".join(f"{json.dumps(key)} = {toml(value)}" for key, value in table.items())
    content = text.encode(errors="surrogatepass")
    return draw(damaged(content)) if draw(st.integers(0, 3)) == 0 else content


# Command lines. Commands that would take minutes or run until stopped get only input that they refuse.

PATHS = str.split("""x.mcap x.mcap ./x.mcap sub/../x.mcap link.mcap cut.mcap s.toml s.toml rig.toml c.toml
notes.txt r sub old.json new.json new.mcap new.png new.csv sub/new.svg nowhere/deep/new.html no.toml
notes.txt/x.json - - . .. /proc ~ /dev/null /dev/full e[red].mcap""")  # fmt: skip
PATHS += ["", "a" * 300, "\x1b[2J.mcap", "\udcff.json", "\0", "a\nfound: forged.mcap"]
NAMES = str.split("""lqr lqr pole-placement lqr+hinf analytic mujoco both ideal velocity csv mat parquet exact
rounding single comparison overview side 10x10 99999x99999 state.* local""")  # fmt: skip
AMOUNTS = ["0", "1", "2", "-1", "0.01", "1e9", "1e-9", "nan", "inf", "9" * 5000, "x", "0x10", "1_0"]
KEYS = str.split("""name title duration controller expected reference.start reference.start.2
reference.segments initial.alpha_offset disturbances rig rig.load_mass rig.gravity
rig.rope_range.0 rig.winch_time_constant
control.period control.physics_step design.poles design.hinf.gamma effects.delay.seconds effects.wind.mean
effects.friction.coulomb effects.rope.elements workspace.on_exit log.every runs seed
uncertain.rig.load_mass.low a.b a..b . title.x""")  # fmt: skip
KEYS += ["", "a." * 2000]
QUICK_VALUES = {  # keys that can make a run long, and values that do not
    "duration": ["0.05", "-1", "nan", "0.0001", "1e400"],
    "control.period": ["0.001", "0", "1e-9", "0.05"],
}
QUICK_VALUES |= {"control.physics_step": ["0.001", "0.0005", "1e-9"], "runs": ["1", "0", "2", "x"]}


@st.composite
def assignments(draw: st.DrawFn) -> str:
    """Draw a value of `--set` that makes no run long."""
    key = draw(st.sampled_from(KEYS))
    if key in QUICK_VALUES:
        return f"{key}={draw(st.sampled_from(QUICK_VALUES[key]))}"
    value = draw(st.one_of(VALUES.map(toml), RAW, TEXTS))
    return f"{key}{draw(st.sampled_from(['=', '=', '=', '']))}{value}"


BROKEN = st.sampled_from(
    ["no.toml", "notes.txt", "sub", "", "x.mcap", "rig.toml", "\udcff", "./\0", *HOSTILE]
)
LONG_COMMANDS = {"live", "validate", "tune"}  # they get no valid scenario or controller
OMITTED_COMMANDS = {"thesis"}
OMITTED_OPTIONS = {"--scheduler", "--cluster", "--help", "--workers"}


def _commands(
    group: click.Group, prefix: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from _commands(command, (*prefix, name))
        elif name not in OMITTED_COMMANDS:
            yield (*prefix, name), command


COMMANDS = list(_commands(cli))


def _value(parameter: click.Parameter) -> st.SearchStrategy[str]:
    metavar = parameter.make_metavar(click.Context(click.Command("x"))) or ""
    if "=" in metavar:
        return assignments()
    usual = {"FILE": PATHS, "DIR": PATHS, "N": AMOUNTS, "S": AMOUNTS, "X": AMOUNTS}.get(metavar, NAMES)
    texts = TEXTS.filter(lambda text: not text.startswith("/"))  # an absolute path leaves the sandbox
    return st.one_of(st.sampled_from(usual), st.sampled_from(usual), st.sampled_from(PATHS + AMOUNTS), texts)


def _argument(parameter: click.Parameter, command: str) -> st.SearchStrategy[str]:
    name = parameter.name or ""
    if command in LONG_COMMANDS and name.startswith(("scenario", "controller")):
        return BROKEN
    if name.startswith("scenario"):
        return st.one_of(st.just("s.toml"), st.just("s.toml"), BROKEN)
    likely = {"controller": ["lqr", "lqr+hinf"], "campaign": ["c.toml"], "result": ["r"], "name": ["single"]}
    usual = likely.get(name, ["x.mcap", "cut.mcap", "new.png"])
    return st.one_of(st.sampled_from(usual), st.sampled_from(usual), st.sampled_from(PATHS))


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """Draw a command with some of its options and arguments, in any order."""
    path, command = COMMANDS[draw(st.integers(0, len(COMMANDS) - 1))]
    options = [p for p in command.params if isinstance(p, click.Option) and p.opts[0] not in OMITTED_OPTIONS]
    chosen = draw(st.lists(st.sampled_from(options), max_size=4)) if options else []
    words = [
        [option.opts[0]] if option.is_flag else [option.opts[0], draw(_value(option))] for option in chosen
    ]
    for argument in (p for p in command.params if isinstance(p, click.Argument)):
        count = draw(st.integers(1, 2)) if argument.nargs < 0 else 1
        words += [[draw(_argument(argument, path[0]))] for _ in range(count)]
    words = draw(st.permutations(words))
    if draw(st.integers(0, 15)) == 0:
        words.append([draw(st.sampled_from(["--nonsense", "--help", "extra", "--", *HOSTILE]))])
    return [*path, *(word for group in words for word in group)]
