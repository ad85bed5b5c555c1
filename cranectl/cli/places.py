"""Places to write to, checked before anything is read or computed."""

from collections.abc import Iterable
from pathlib import Path

from cranectl.errors import InputError


def refuse_overwriting(inputs: Iterable[Path], out: Path, option: str) -> None:
    """Raise InputError if `out` is one of the files that are read."""
    if any(out.resolve() == path.resolve() for path in inputs):
        raise InputError(
            f"{option} {out} is the log that is read",
            allowed="another file",
            remedy=f"choose another place with {option}",
        )
