"""What of Python source counts in a digest: what runs, in all versions of Python alike."""

import pytest

from cranectl.support.provenance import Provenance

SOURCE = b'''"""A gain."""

GAIN = 16.0


def gain(length, *, unit="m"):
    """Return it."""
    return f"{GAIN * length:.3f} " f"{unit}"
'''


@pytest.mark.parametrize(
    ("old", "new", "counts"),
    [
        (b"A gain", b"Another sentence", False),
        (b'    """Return it."""\n', b"", False),
        (b"GAIN = 16.0", b"GAIN = 16.0  # of the drive", False),
        (b"(length, *, unit", b"(\n    length,\n    *,\n    unit", False),
        (b"\n", b"\r\n", False),
        (b"16.0", b"16.5", True),
        (b'"m"', b'"mm"', True),
        (b"*, unit", b"unit", True),
        (b":.3f", b":.4f", True),
        (b"GAIN *", b"GAIN +", True),
        (b'f"{unit}"\n', b'f"{unit}"\ngain.__doc__\n', True),
    ],
)
def test_what_runs_counts_and_comments_docstrings_and_layout_do_not(
    old: bytes, new: bytes, counts: bool
) -> None:
    other = SOURCE.replace(old, new)
    assert other != SOURCE
    assert (Provenance.syntax_of(other) != Provenance.syntax_of(SOURCE)) == counts


def test_docstrings_count_where_they_are_read() -> None:
    read = SOURCE + b"LENGTH = float(gain.__doc__)\n"
    assert Provenance.syntax_of(read) != Provenance.syntax_of(read.replace(b"Return it.", b"2.0"))


def test_the_text_is_that_of_every_version_of_python() -> None:
    assert Provenance.syntax_of(b"gain: 16\x00") == b"gain: 16\x00", "what is no Python counts as it is"
    assert Provenance.syntax_of(b'def f(x):\n    "It."\n    return f"{x:{3}}a" "b"\n').decode() == (
        "Module(body=[FunctionDef(name='f',args=arguments(args=[arg(arg='x')]),"
        "body=[Return(value=JoinedStr([FormattedValue(value=Name(id='x',ctx=Load()),conversion=-1,"
        "format_spec=JoinedStr([FormattedValue(value=Constant(value=3),conversion=-1)])),'ab']))])])"
    )
