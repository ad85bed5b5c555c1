"""Read TOML and JSON from outside, within limits of size and depth that no honest file reaches."""

import json
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from cranectl.support.errors import InputError
from cranectl.support.file_kinds import BYTE_ORDER_MARK, FileKind
from cranectl.support.files import File

Table = dict[str, Any]  # a table of TOML, whose values may be tables and lists
Content = TypeVar("Content")

# Scenarios, campaigns and designs have some thousands; a MiB takes half a second to parse.
MAX_DOCUMENT_BYTES = 2**20
MAX_BITS = 1023  # of a whole number: each of these becomes a float, the largest of 1024 bits do not
MAX_DEPTH = 32  # tables and lists within one another; ours have five
_TWICE = "Cannot overwrite", "Cannot declare"  # of tomllib, for a key that stands there twice
# A dotted key of more parts than that, for which tomllib takes quadratic time.
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_KEY = re.compile(rf"(?:^|[\[{{,])[ \t]*(?:{_PART}){{{MAX_DEPTH}}}", re.MULTILINE)


@dataclass(frozen=True)
class DocumentFormat(Generic[Content]):
    """A format of settings that come from outside.

    Parameters
    ----------
    name : str
        In messages.
    loads : callable
        Returns the content of a text, or raises ValueError.
    """

    name: str
    loads: Callable[[str], Content]

    MAX_DEPTH: ClassVar = MAX_DEPTH

    def read(self, path: Path) -> Content:
        """Read a file; raise InputError if it is missing, too large or of another format."""
        try:
            with File(path).open(piped=MAX_DOCUMENT_BYTES + 1) as file:
                content = file.read(MAX_DOCUMENT_BYTES + 1)
        except (OSError, ValueError) as error:  # ValueError: a null character in the name
            raise InputError(
                f"cannot read {path}: {error}", remedy=f"name a readable {self.name} file"
            ) from None
        return self.parse(content, str(path))

    def parse(self, content: str | bytes, source: str) -> Content:
        """Return the content of a text; raise InputError that names `source` if it breaks the limits."""
        try:
            return _limited(self.loads, content, source)
        except (InputError, ValueError) as error:  # ValueError: of tomllib, of json, or no UTF-8
            other = FileKind.named(content.encode(errors="replace") if isinstance(content, str) else content)
            if other and other != self.name:
                raise InputError(
                    f"{source} is {other}, not {self.name}",
                    allowed=f"settings as {self.name} in UTF-8",
                    remedy=f"name a {self.name} file, or write the settings into one",
                ) from None
            raise error if isinstance(error, InputError) else self._invalid(source, error) from None

    def _invalid(self, source: str, error: ValueError) -> InputError:
        return InputError(
            f"{source} is not valid {self.name}: {error}",
            allowed=f"{self.name} in UTF-8, whole numbers of at most {MAX_BITS} bits",
            remedy="write that key once, either as a value or as a table"
            if str(error).startswith(_TWICE)
            else "correct it at that place",
        )


class _Toml(DocumentFormat[Table]):
    """TOML, in which cranectl also writes settings, and whose values stand behind `--set`."""

    def value(self, text: str, source: str) -> Any:
        """Return the TOML value of `text`, else `text` itself; raise InputError beyond the limits."""
        try:
            table = _limited(self.loads, f"value = {text}", source)
        except tomllib.TOMLDecodeError:
            table = {}
        except ValueError as error:
            raise self._invalid(source, error) from None
        # A text with a line such as `x = 2` in it would give a second key.
        return table["value"] if len(table) == 1 else DocumentFormat("text", str).parse(text, source)

    def text(self, table: Mapping[str, Any], above: str = "") -> str:
        """Return the TOML text of a table; None is left out, because TOML has no such value."""
        lines, below = [], []
        for name, value in table.items():
            key = name if re.fullmatch(r"[\w-]+", name, re.ASCII) else json.dumps(name)
            if isinstance(value, Mapping):
                below.append(f"\n[{above}{key}]\n{self.text(value, f'{above}{key}.')}")
            elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
                below += [f"\n[[{above}{key}]]\n{self.text(item, f'{above}{key}.')}" for item in value]
            elif value is not None:
                lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}\n")
        return "".join([*lines, *below])


def _toml(text: str) -> Table:
    if _LONG_KEY.search(text):
        raise RecursionError
    return tomllib.loads(text)


def _limited(parse: Callable[[str], Content], content: str | bytes, source: str) -> Content:
    """Return what `parse` returns; raise InputError beyond the limits, else ValueError as `parse` does."""
    if len(content) > MAX_DOCUMENT_BYTES:
        raise InputError(
            f"{source} is larger than {MAX_DOCUMENT_BYTES} bytes",
            allowed="files of settings, which have some thousands",
            remedy="check that this is the right file",
        )
    text = content if isinstance(content, str) else content.decode()
    try:
        parsed = parse(text.removeprefix(BYTE_ORDER_MARK))
        _check_depth(parsed)
    except RecursionError:
        raise InputError(
            f"{source} nests tables, lists or dotted keys more than {MAX_DEPTH} deep",
            allowed=f"at most {MAX_DEPTH} levels; settings have five",
            remedy="check that this is the right file",
        ) from None
    return parsed


def _check_depth(content: Any) -> None:
    """Raise RecursionError for too deep nesting, ValueError for values that cannot be printed."""
    level = [content]
    for _ in range(MAX_DEPTH):
        nested: list[Any] = []
        for node in level:
            if isinstance(node, dict):
                nested += node.keys()
                nested += node.values()
            elif isinstance(node, list):
                nested += node
            elif isinstance(node, str):
                node.encode()  # a surrogate without its partner is no text: UnicodeEncodeError
            elif isinstance(node, int) and node.bit_length() > MAX_BITS:
                raise ValueError("a whole number of hundreds of digits")
        if not nested:
            return
        level = nested
    raise RecursionError


# Reads tables of TOML, and writes them.
TOML = _Toml("TOML", _toml)
# Reads values of JSON.
JSON = DocumentFormat[Any]("JSON", json.loads)
