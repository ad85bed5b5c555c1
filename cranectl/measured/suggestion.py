"""Suggest a map from what a measured file holds: columns, their numbers, and what their names may mean."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cranectl.measured.columns import TableHead
from cranectl.measured.mapping import ANGLES, COMMAND_UNITS, COMMANDS, LOAD, POSITIONS, TIMES, UNITS
from cranectl.measured.tables import read_head
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

MOST_SHOWN = 100  # columns
_UNIT = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
# What names of columns look like, by signal; the first that fits and is free is suggested.
_PATTERNS = {
    "time": r"^(t|time|timestamp|stamp|zeit|clock)\b|time",
    "bridge_command": r"(cmd|set|ref|soll|command|des).*(bridge|x)|(bridge|x).*(cmd|set|command|soll)|^wx\b",
    "trolley_command": r"(cmd|set|ref|soll|command|des).*(trolley|y)|(trolley|y).*(cmd|set|soll)|^wy\b",
    "rope_command": r"(cmd|set|ref|soll|command|des).*(rope|hoist|l)|(rope|hoist|l).*(cmd|set|command)|^wl\b",
    "alpha": r"alpha|theta_?y|angle_?y|phi|roll",
    "beta": r"beta|theta|angle|sway|swing|pitch",
    "load_x": r"(load|payload|last).*x",
    "load_y": r"(load|payload|last).*y",
    "load_z": r"(load|payload|last).*z",
    "rope_length": r"rope|cable|hoist|length|^l\b|seil",
    "trolley_position": r"trolley.*y|^y\b|katze|pos.*y",
    "bridge_position": r"bridge|^x\b|cart|trolley|pos|kran",
}
_DESCRIPTIONS = {
    "bridge_position": "along x",
    "trolley_position": "along y",
    "rope_length": "from pivot to load",
    "alpha": "positive if the load is at larger y than its pivot",
    "beta": "positive if the load is at larger x than its pivot",
}


def suggest_map(path: Path) -> str:
    """Return the text of a map for the file at `path`; raise InputError if it cannot be read."""
    head = read_head(path)
    columns = [_range(head, k) for k in range(min(len(head.names), MOST_SHOWN))]
    guesses = _guesses(head.names)
    lines = [f"# Columns of {path.name}: number, name, smallest and largest value"]
    lines += [
        f"#   {k}: {name}: {text}" for k, (name, text) in enumerate(zip(head.names, columns, strict=False), 1)
    ]
    lines += [
        "#",
        "# Fill in ???, and check the rest. A signal that does not change has a value in place of a column:",
        '# trolley_position = {value = 0.0, unit = "m"}. Further keys of a signal are sign, scale, delay,',
        "# zero (the reading at which it is zero) and file (its number on the command line).",
        f'name = "{_name(path)}"',
        'rig = "lab-rig"  # name or file of the crane',
        "# from = 0.0",
        "# to = 10.0",
    ]
    has_commands = all(name in guesses for name in COMMANDS)
    lines += ['commands = "velocity"  # or acceleration, force'] if has_commands else []
    lines += ["", "[time]"]
    if "time" in guesses:
        unit = _unit(head.names[guesses["time"]], TIMES)
        lines += [f"column = {_key(head.names, guesses['time'])}", f'unit = "{unit or "???"}"']
    else:
        lines += ["period = ???  # [s], of a file without a clock"]
    lines += ["", "[signals]"]
    for group in (POSITIONS, ANGLES, LOAD, COMMANDS):
        if group in (LOAD, COMMANDS) and not all(name in guesses for name in group):
            continue
        units = COMMAND_UNITS["velocity"] if group == COMMANDS else UNITS[group[0]]
        for name in group:
            column = _key(head.names, guesses[name]) if name in guesses else "???"
            unit = _unit(head.names[guesses[name]], units) if name in guesses else ""
            remark = f"  # {_DESCRIPTIONS[name]}" if name in _DESCRIPTIONS else ""
            lines.append(f'{name} = {{column = {column}, unit = "{unit or "???"}"}}{remark}')
    return "\n".join(lines) + "\n"


def _guesses(names: Sequence[str]) -> dict[str, int]:
    """Return the index of the column that each signal may be in."""
    guesses: dict[str, int] = {}
    for signal, pattern in _PATTERNS.items():
        for k, name in enumerate(names):
            bare = _UNIT.sub("", name).strip()
            if k not in guesses.values() and re.search(pattern, bare, re.IGNORECASE):
                guesses[signal] = k
                break
    return guesses


def _range(head: TableHead, index: int) -> str:
    """Return the smallest and the largest value of a column as text."""
    try:
        column = head.read(index)
    except InputError as error:
        return error.found.rpartition("holds ")[2]
    values: Array = column.values[np.isfinite(column.values)]
    if not len(values):
        return "no values"
    stamps = "time stamps, " if column.is_time else ""
    return f"{stamps}{values.min():.6g} to {values.max():.6g}, {len(values)} of {len(column.values)} rows"


def _unit(name: str, units: dict[str, float]) -> str:
    """Return the unit in brackets at the end of a column's name, if it is one of `units`."""
    match = _UNIT.search(name)
    unit = (
        {"°": "deg", "degree": "deg", "degrees": "deg", "sec": "s"}.get(match[1], match[1]) if match else ""
    )
    return unit if unit in units else ""


def _key(names: Sequence[str], index: int) -> str:
    """Return how a map names a column: by its name, or by its number if that is not enough."""
    name = names[index]
    plain = (
        names.count(name) == 1
        and name != str(index + 1)
        and name.isprintable()
        and not set(name) & set('"\\\\')
    )
    return f'"{name}"' if plain else str(index + 1)


def _name(path: Path) -> str:
    name = re.sub(r"[^a-z0-9]+", "-", path.stem.lower()).strip("-")
    return name or "measured"
