"""Check a model file of a user before the engine reads it: which files it reads, and how large it becomes.

A few characters, such as the size of a texture, can ask for more memory than a machine has. A pipe in place
of a mesh would be waited for without end.
"""

import hashlib
import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from cranectl.support import InputError

FOLDERS = ("meshdir", "texturedir", "assetdir")  # attributes of a compiler element
MAX_FILES = 1000  # that a model reads
MAX_MODEL_BYTES = 2**28  # of all these files
MAX_TEXT = 2**24  # of one file in MJCF
MAX_CELLS = 2**24  # pixels of all textures, and points of all height fields: 4096 times 4096
MAX_NUMBERS = 10**6  # of what an attribute of `size` makes room for, and other lengths
MAX_COPIES = 10**4  # of a body
MAX_ARENA = 2**30  # [bytes] of the engine's working memory
MAX_SUBDIVISIONS = 6  # of a sphere: each quadruples its faces
UNITS = {unit: 1024**power for power, unit in enumerate("KMGTPE", 1)}
PNG, PNG_SIZE = b"\x89PNG\r\n\x1a\n", slice(16, 24)  # how such a picture begins; width and height


def check_files(file: Path) -> list[Path]:
    """Return the files that a model reads; raise InputError if it must not, or would take too much memory.

    Files must be regular ones in the model's folder or below it. Each included file is judged in this way
    before it is read.
    """
    folder = file.parent.resolve()
    paths, starts, named = [file], [folder], dict[str, None]()
    cells, copies = dict.fromkeys(("texture", "hfield"), 0.0), 1.0
    for path in paths:  # which grows
        _check(file, f"bytes of text in {path.name}", path.stat().st_size, MAX_TEXT)
        root = ElementTree.parse(path).getroot()
        for element in root.iter():
            starts += [folder / value for key, value in element.items() if key in FOLDERS]
            # Textures also have `fileup`, `fileleft` and others, one for each face of a cube.
            names = [value for key, value in element.items() if key.startswith("file") and value]
            named |= dict.fromkeys(names)
            parts = [folder / name for name in names if element.tag in ("include", "model")]
            for name in names:
                _check_place(file, folder, [folder], name)
            paths += [part for part in parts if part not in paths and part.is_file()]
            _check_element(file, element, cells)
        copies *= _copies(root)
        _check(file, "copies of a body", copies, MAX_COPIES)
    size = sum(_check_place(file, folder, starts, name) for name in named)
    _check(file, "files", len(named), MAX_FILES)
    _check(file, "bytes in files", size, MAX_MODEL_BYTES)
    read = [path for path in sorted({start / name for start in starts for name in named}) if path.is_file()]
    for picture in read:
        _check(file, f"pixels in {picture.name}", _pixels(picture), MAX_CELLS)
    return [file, *read]


def content_digest(file: Path) -> str:
    """Return a digest of a model file and of all files that it reads, "" for a model that is refused."""
    digest = hashlib.sha256()
    try:
        for path in check_files(file):
            content = path.read_bytes()
            digest.update(f"{path}\0{len(content)}\0".encode() + content)
    except (OSError, ElementTree.ParseError, InputError):
        return ""  # whoever opens it says why
    return digest.hexdigest()


def check_finite(file: Path, model: mujoco.MjModel) -> None:
    """Raise InputError if a number of a compiled model is infinite or NaN."""
    for name in dir(model):
        values = None if name.startswith("_") else getattr(model, name)
        if isinstance(values, np.ndarray) and values.dtype.kind == "f" and not np.isfinite(values).all():
            raise InputError(
                f"{file}: {name} of its model has numbers that are infinite or NaN",
                allowed="finite numbers",
                remedy=f"correct the attributes that {name} is made of",
            )


def _check_place(file: Path, folder: Path, starts: list[Path], name: str) -> int:
    """Return the bytes of the file `name`; raise InputError unless it is a regular file below `folder`."""
    size = 0
    for start in starts:
        path = (start / name).resolve()
        if not path.is_relative_to(folder):
            raise InputError(
                f"{file} reads {name}",
                allowed="files in the folder of the model, or below it",
                remedy="copy the file there, and name it without '..'",
            )
        if path.is_file():
            size = max(size, path.stat().st_size)
        elif path.exists():
            raise InputError(
                f"{file} reads {name}, which is a directory, a pipe or a device",
                allowed="regular files",
                remedy="put a copy of the data into a file",
            )
    return size


def _cells(element: Element) -> float:
    """Return how many pixels a texture of MuJoCo's own pattern has, or points a height field."""
    if element.tag == "hfield":
        return _number(element, "nrow") * _number(element, "ncol")
    faces = 1 if element.get("type") in ("2d", "skybox") else 6
    width, height = _number(element, "width"), _number(element, "height")
    return faces * width * (height or width)


def _sizes(element: Element) -> Iterator[tuple[str, float, float]]:
    """Yield what sizes an element asks for, how large they are, and how large they may be."""
    if element.tag == "size":
        for key, value in element.items():
            if key == "memory":
                yield key, _bytes(value), MAX_ARENA
            else:
                yield key, _number(element, key), MAX_NUMBERS
    for key in ("dim", "nsample", "size") if element.tag in ("numeric", "user", "plugin") else ("nsample",):
        yield key, _number(element, key), MAX_NUMBERS
    if element.tag == "mesh" and element.get("builtin"):
        allowed = MAX_SUBDIVISIONS if element.get("builtin") == "sphere" else math.isqrt(MAX_NUMBERS)
        yield "params", _number(element, "params"), allowed


def _copies(element: Element) -> float:
    """Return how often elements repeat the innermost body, at most over the children of an element."""
    own = max((_copies(part) for part in element), default=1.0)
    if element.tag in ("replicate", "composite", "flexcomp"):
        for number in _numbers(element.get("count", "")):
            own *= max(number, 1.0)
    return own


def _check(file: Path, what: str, number: float, allowed: float) -> None:
    """Raise InputError unless a model asks for at most as much of `what` as is allowed."""
    if not number <= allowed:  # also if it is NaN
        raise InputError(
            f"{file} asks for {number:.10g} {what}",
            allowed=f"at most {allowed:.10g}",
            remedy="ask for less, or leave out what no crane needs, such as pictures",
        )


def _check_element(file: Path, element: Element, cells: dict[str, float]) -> None:
    """Raise InputError if an element asks for too much; add up `cells` of all elements by their tag."""
    if element.tag in cells:
        cells[element.tag] += _cells(element)
        _check(file, f"pixels or points in <{element.tag}>", cells[element.tag], MAX_CELLS)
    for what, number, allowed in _sizes(element):
        _check(file, f"{what} in <{element.tag}>", number, allowed)


def _number(element: Element, key: str) -> float:
    """Return the first number of an attribute, and 0 where there is none."""
    return next(iter(_numbers(element.get(key, ""))), 0.0)


def _numbers(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError:  # the engine names it
        return []


def _bytes(text: str) -> float:
    """Return a size of memory such as 100M in bytes."""
    unit = text.strip()[-1:].upper()
    numbers = _numbers(text.strip()[:-1] if unit in UNITS else text)
    return float(UNITS.get(unit, 1)) * (numbers[0] if numbers else 0.0)


def _pixels(picture: Path) -> int:
    """Return how many pixels a picture says that it has."""
    with picture.open("rb") as stream:
        beginning = stream.read(PNG_SIZE.stop)
    if not beginning.startswith(PNG):
        return 0
    width, height = beginning[PNG_SIZE][:4], beginning[PNG_SIZE][4:]
    return int.from_bytes(width, "big") * int.from_bytes(height, "big")
