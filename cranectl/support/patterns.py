"""Shell patterns over dotted signal names: `mujoco.state.*`, `*.alpha`, `load.load_[xy]`."""

from collections.abc import Iterable
from fnmatch import fnmatchcase

from cranectl.support.errors import InputError, did_you_mean, nearest_first

SHOWN_NEAR_NAMES = 6  # as many near names as fit a line or two


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """The names that `pattern` matches, in their order; `*` passes over dots too."""
    return [name for name in names if fnmatchcase(name, pattern)]


def unmatched(pattern: str, names: Iterable[str]) -> InputError:
    """The error for a pattern that matches none of `names`; lists the nearest names and groups."""
    known = list(names)
    groups = {name.rpartition(".")[0] + ".*" for name in known}
    near = nearest_first(pattern, groups if pattern.endswith("*") else {*known, *groups})[:SHOWN_NEAR_NAMES]
    return InputError(
        f"no signal matches '{pattern}'",
        allowed=f"patterns of signal names, the nearest being {', '.join(near)}" if near else "",
        remedy=did_you_mean(pattern, near) or "choose among the signals that docs/reference/logs.md lists",
    )
