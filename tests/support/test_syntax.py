"""What of Python source counts in a digest: what runs, in all versions of Python alike."""

import pytest

from cranectl.support.provenance import syntax_of

SOURCE = b'''"""A gain."""

GAIN = 16.0


def gain(length, *, unit="m"):
    """Return it."""
    return f"{GAIN * length:.3f} " f"{unit}"
'''


@pytest.mark.parametrize(
    "other",
    [
        SOURCE.replace(b"A gain", b"Another sentence"),
        SOURCE.replace(b'    """Return it."""\n', b""),
        SOURCE.replace(b"GAIN = 16.0", b"GAIN = 16.0  # of the drive"),
        SOURCE.replace(b"(length, *, unit", b"(\n    length,\n    *,\n    unit"),
        SOURCE.replace(b"\n", b"\r\n"),
    ],
)
def test_comments_docstrings_and_layout_do_not_count(other: bytes) -> None:
    assert other != SOURCE
    assert syntax_of(other) == syntax_of(SOURCE)


@pytest.mark.parametrize(
    "other",
    [
        SOURCE.replace(b"16.0", b"16.5"),
        SOURCE.replace(b'"m"', b'"mm"'),
        SOURCE.replace(b"*, unit", b"unit"),
        SOURCE.replace(b":.3f", b":.4f"),
        SOURCE.replace(b"GAIN *", b"GAIN +"),
        SOURCE + b"gain.__doc__\n",
    ],
)
def test_what_runs_counts(other: bytes) -> None:
    assert syntax_of(other) != syntax_of(SOURCE)


def test_docstrings_count_where_they_are_read() -> None:
    read = SOURCE + b"LENGTH = float(gain.__doc__)\n"
    assert syntax_of(read) != syntax_of(read.replace(b"Return it.", b"2.0"))


def test_what_is_no_python_counts_as_it_is() -> None:
    assert syntax_of(b"gain: 16\x00") == b"gain: 16\x00"


def test_the_text_is_that_of_every_version_of_python() -> None:
    assert syntax_of(b'def f(x):\n    "It."\n    return f"{x:{3}}a" "b"\n').decode() == (
        "Module(body=[FunctionDef(name='f',args=arguments(args=[arg(arg='x')]),"
        "body=[Return(value=JoinedStr([FormattedValue(value=Name(id='x',ctx=Load()),conversion=-1,"
        "format_spec=JoinedStr([FormattedValue(value=Constant(value=3),conversion=-1)])),'ab']))])])"
    )
