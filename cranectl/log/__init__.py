"""Logs: one MCAP file for a run or those of several plants, written, read and described."""

from cranectl.log.header import check_recordable
from cranectl.log.reader import LogDescription, describe_log, read_log, read_signal
from cranectl.log.recover import recover_log
from cranectl.log.writer import check_writable, write_log, write_logged

__all__ = [
    "LogDescription",
    "check_recordable",
    "check_writable",
    "describe_log",
    "read_log",
    "read_signal",
    "recover_log",
    "write_log",
    "write_logged",
]
