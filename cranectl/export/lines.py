"""Break lines of C."""

import re
import textwrap

C_LINE_WIDTH = 110  # of lines in C
KEPT = "\xa0"  # a space at which no line is broken
_COMMENT = re.compile(r" /\*.*?\*/")


def filled(text: str, indent: str) -> str:
    """Return a line of C, broken where it is too long, but not within comments."""
    kept = _COMMENT.sub(lambda match: match[0].replace(" ", KEPT), text)
    lines = textwrap.wrap(kept, C_LINE_WIDTH, initial_indent=indent, subsequent_indent=indent + "    ",
                          break_long_words=False, break_on_hyphens=False)  # fmt: skip
    return "\n".join(lines).replace(KEPT, " ")
