"""Odd command lines end with a documented exit code, and change no file that they must not change."""

from pathlib import Path

from hypothesis import strategies as st

from tests.fuzz.oracle import check_command, fuzzed
from tests.fuzz.strategies import command_lines


@fuzzed(60, line=command_lines(), stream=st.sampled_from(["utf-8", "utf-8", "ascii", "cp1252", "full"]))
def test_odd_command_lines_end_as_documented(template: Path, line: list[str], stream: str) -> None:
    check_command(template, line, stream=stream)
