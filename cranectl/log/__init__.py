"""Logs: one MCAP file for a run or a pair of runs, written, read and described."""

from cranectl.log.describe import LogDescription, describe_log
from cranectl.log.reader import read_log
from cranectl.log.writer import check_writable, write_log

__all__ = ["LogDescription", "check_writable", "describe_log", "read_log", "write_log"]
