"""Text from outside, such as titles, paths and names, made fit for a screen or a message."""

LONGEST = 500  # [characters] of a phrase


def printable(text: str, *, longest: int = LONGEST) -> str:
    """`text` on one line: what acts on a screen becomes an escape, the middle of a long text is left out."""
    if len(text) > longest:
        ends = longest // 2
        left_out = f" … {len(text) - 2 * ends} characters … "
        return printable(text[:ends], longest=ends) + left_out + printable(text[-ends:], longest=ends)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
