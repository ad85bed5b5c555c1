"""Suggest a map from what a measured file holds: columns, their numbers, and what their names may mean."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cranectl.support import Array, InputError, TableHead, printable
from cranectl.tools.measured.mapping import ANGLES, COMMAND_UNITS, COMMANDS, LOAD, POSITIONS, TIMES, UNITS
from cranectl.tools.measured.tables import read_head

MAX_SHOWN_COLUMNS = 100  # columns
MAX_COMPARED_ROWS, MIN_COMPARED_ROWS = 20_000, 20  # in which a column is compared with slopes of others
STEADY = 1e-6  # share of a slope that changes, of a column that is no clock
_UNIT = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
_COMMAND = "cmd command control set setpoint ref reference soll desired target w"
_X, _Y = "bridge x kran brücke bruecke gantry", "trolley cart y katze laufkatze"
_ROPE = "rope cable hoist length l seil winch seillänge seillaenge hub hubwerk"
_ANGLE = "angle sway swing pitch theta winkel pendelwinkel"
# A signal, and the words of which the name of its column has one of each group. The name with the fewest
# words is suggested.
_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("time", ("t time timestamp stamp zeit clock",)),
    ("bridge_command", (_COMMAND, _X)),
    ("trolley_command", (_COMMAND, _Y)),
    ("rope_command", (_COMMAND, _ROPE)),
    ("load_x", ("load payload last", "x")),
    ("load_y", ("load payload last", "y")),
    ("load_z", ("load payload last", "z")),
    ("alpha", ("alpha phi roll",)),
    ("alpha", (_ANGLE, _Y)),
    ("beta", ("beta",)),
    ("beta", (_ANGLE,)),
    ("rope_length", (_ROPE,)),
    ("bridge_position", (_X,)),
    ("trolley_position", (_Y,)),
)
# Words of columns that are no signals of a map: rates, and what happens inside drives.
_OTHERS = (
    "derivative dot ddot rate speed velocity vel acceleration acc force tension error voltage current pwm "
    "geschwindigkeit beschleunigung kraft moment strom spannung fehler duration dauer temperature temperatur"
)
_UNIT_NAMES = {
    **dict.fromkeys(("°", "degree", "degrees", "grad"), "deg"),
    **dict.fromkeys(("sec", "second", "seconds", "sekunden"), "s"),
    **dict.fromkeys(("m/s²", "m/s2", "m/s**2"), "m/s^2"),
    "meter": "m",
}
_SPEEDS = {"velocity", "speed", "geschwindigkeit"}  # which commands may be
_HEIGHTS = {"height", "höhe", "hoehe"}  # that a load has instead of a length of its rope
_PREFIX = re.compile(r"^(soll|ist)(?=\w{3})")  # of German words for commands and readings
SAME_SHAPE = 0.98  # correlation of a column with the slope of another, of which it is the rate
_PARTNER = {  # the signal along the other axis
    "bridge_position": "trolley_position",
    "trolley_position": "bridge_position",
    "alpha": "beta",
    "beta": "alpha",
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
    columns = [_range(head, k) for k in range(min(len(head.names), MAX_SHOWN_COLUMNS))]
    stated = [head.unit(k) for k in range(len(head.names))]
    titles = [f"{name} [{unit}]" if unit else name for name, unit in zip(head.names, stated, strict=True)]
    units = [_stated_unit(head, k) for k in range(len(head.names))]
    guesses = guessed_columns(head.names, units, _rates(head))
    stamps = [k for k in range(min(len(head.names), MAX_SHOWN_COLUMNS)) if _is_clock(head, k)]
    is_planar = all(_is_known(name, k in guesses.values()) for k, name in enumerate(head.names))
    lines = [f"# Columns of {path.name}: number, name, smallest and largest value"]
    lines += [
        f"#   {k}: {name}: {text}" for k, (name, text) in enumerate(zip(titles, columns, strict=False), 1)
    ]
    lines += [f"#   not read: {printable(part)}" for part in head.left_out]
    lines += [
        "#",
        "# Fill in ???, and check the rest. A signal that does not change has a value in place of a column:",
        '# trolley_position = {value = 0.0, unit = "m"}. Further keys of a signal are sign, scale, delay,',
        "# zero (the reading at which it is zero) and file (its number on the command line).",
        f'name = "{run_name(path.stem)}"',
        'rig = "lab-rig"  # name or file of the crane',
        "# from = 0.0",
        "# to = 10.0",
    ]
    has_commands = all(name in guesses for name in COMMANDS)
    lines += ['commands = "velocity"  # or acceleration, force'] if has_commands else []
    lines += ["", "[time]"]
    clocks = [guesses["time"]] if "time" in guesses else stamps
    if len(clocks) == 1 and clocks[0] in stamps:
        lines.append(f"column = {_key(head.names, clocks[0])}  # time stamps")
    elif "time" in guesses:
        unit = _unit(units[guesses["time"]], TIMES)
        lines += [f"column = {_key(head.names, guesses['time'])}", f'unit = "{unit or "???"}"']
    else:
        lines += ["period = ???  # [s], of a file without a clock"]
    lines += ["", "[signals]"]
    for group in (POSITIONS, ANGLES, LOAD, COMMANDS):
        if group in (LOAD, COMMANDS) and not all(name in guesses for name in group):
            continue
        allowed = COMMAND_UNITS["velocity"] if group == COMMANDS else UNITS[group[0]]
        for name in group:
            remark = _remark(name, head.names[guesses[name]] if name in guesses else "")
            if name in guesses:
                unit = _unit(units[guesses[name]], allowed)
                source = f'column = {_key(head.names, guesses[name])}, unit = "{unit or "???"}"'
            elif _PARTNER.get(name) in guesses and is_planar:
                source, remark = f'value = 0.0, unit = "{next(iter(allowed))}"', f"{remark}; not measured"
            else:
                source = 'column = ???, unit = "???"'
            lines.append(f"{name} = {{{source}}}{remark}")
    return "\n".join(lines) + "\n"


def _remark(signal: str, column: str) -> str:
    """Return what stands behind a signal that the column of this name holds."""
    remark = f"  # {_DESCRIPTIONS[signal]}" if signal in _DESCRIPTIONS else ""
    if signal == "rope_length" and _words(column) & _HEIGHTS:
        remark += "; of a height: sign = -1, and zero = the height of the pivot"
    return remark


def guessed_columns(
    names: Sequence[str], units: Sequence[str] = (), rates: frozenset[int] = frozenset()
) -> dict[str, int]:
    """Return the index of the column that each signal may be in; a signal that fits several has none.

    A column fits by the words of its name and by its unit, an empty text if none is stated. `rates` are
    columns that hold the slope of another one.
    """
    words, units = [_words(name) for name in names], units or [""] * len(names)
    guesses: dict[str, int] = {}
    for signal, groups in _WORDS:
        others = {*_OTHERS.split()} ^ (_SPEEDS if signal in COMMANDS else {*_COMMAND.split()})
        fitting = [
            k
            for k, found in enumerate(words)
            if k not in guesses.values()
            and not found & others
            and (not units[k] or units[k] in _allowed_units(signal))
            and all(found.intersection(group.split()) for group in groups)
        ]
        # Best with a plain name and a unit. Slopes of others come last, but on a circle y is one of x.
        ranks = {k: (k in rates and signal not in COMMANDS, not units[k], len(words[k])) for k in fitting}
        ranked = sorted(fitting, key=ranks.__getitem__)
        is_clear = len(ranked) == 1 or (len(ranked) > 1 and ranks[ranked[0]] < ranks[ranked[1]])
        if is_clear and signal not in guesses:
            guesses[signal] = ranked[0]
    if "trolley_position" in guesses and not guesses.keys() & {"bridge_position", "alpha"}:
        guesses |= {"alpha": guesses.pop("beta")} if "beta" in guesses else {}  # a planar rig
    return guesses


def _allowed_units(signal: str) -> set[str]:
    """Return the units that the readings of a signal, or times, can have."""
    if signal == "time":
        return {*TIMES}
    if signal in COMMANDS:
        return {unit for units in COMMAND_UNITS.values() for unit in units}
    return {*UNITS[signal]}


def _is_known(name: str, is_guessed: bool) -> bool:
    """Return whether it is known what a column holds: a signal, or nothing that a map has."""
    return is_guessed or bool(_words(name) & {*_OTHERS.split(), *_COMMAND.split()})


def _words(name: str) -> frozenset[str]:
    """Return the words of a column's name, without its unit: 'swayAngle_y [deg]' has sway, angle and y."""
    words = re.findall(r"[^\W\d_]+", _UNIT.sub("", name))
    parts = (
        re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", word) if word.isascii() else [word] for word in words
    )
    lower = (part.lower() for found in parts for part in found)
    return frozenset(part for word in lower for part in _PREFIX.sub(r"\1 ", word, count=1).split())


def _rates(head: TableHead) -> frozenset[int]:
    """Return the columns whose values are the slope of another column over the rows."""
    columns = {}
    for k in range(min(len(head.names), MAX_SHOWN_COLUMNS)):
        try:
            values: Array = head.read(k).values[:MAX_COMPARED_ROWS]
        except InputError:
            continue
        if len(values) > MIN_COMPARED_ROWS and np.isfinite(values).all() and values.any():
            columns[k] = values / np.abs(values).max()  # whose squares are in range, whatever the unit
    columns = {k: values for k, values in columns.items() if np.ptp(values) > 0.0}
    rates = set()
    for k, values in columns.items():
        for other, candidate in columns.items():
            slope = np.gradient(candidate) if other != k and len(candidate) == len(values) else None
            if slope is not None and np.std(slope) > STEADY * np.abs(slope).max():
                rates |= {k} if np.corrcoef(slope, values)[0, 1] > SAME_SHAPE else set()
    return frozenset(rates)


def _is_clock(head: TableHead, index: int) -> bool:
    """Return whether a column holds time stamps."""
    try:
        return head.read(index).is_time
    except InputError:
        return False


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


def _stated_unit(head: TableHead, index: int) -> str:
    """Return the unit of a column: that of the file, or that in brackets at the end of its name."""
    match = _UNIT.search(head.names[index])
    unit = head.unit(index) or (match[1] if match else "")
    return _UNIT_NAMES.get(unit.lower(), unit)


def _unit(unit: str, units: dict[str, float]) -> str:
    """Return a unit if it is one of `units`."""
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


def run_name(stem: str) -> str:
    """Return a valid name of runs that belong to a file with the name `stem`, without its ending."""
    name = re.sub(r"[^a-z0-9]+", "-", stem.lower()).strip("-")
    return name or "measured"
