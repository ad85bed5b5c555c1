"""A figure as a file of its own."""

from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from cranectl.support.errors import InputError
from cranectl.support.files import replacing

UNDATED: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


def save_figure(figure: Figure, path: Path) -> None:
    """Draw to `path`, format by its suffix; raises InputError if that cannot be done."""
    kind = path.suffix.lower()
    try:
        # No date and no random identifiers: the same figure, the same bytes.
        with matplotlib.rc_context({"svg.hashsalt": "cranectl"}), replacing(path) as part:
            figure.savefig(part, format=kind[1:] or None, metadata=UNDATED.get(kind))
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot draw to {path}: {error}",
            allowed="a .svg, .pdf or .png file in an existing directory",
            remedy="choose another file with --plot",
        ) from None
