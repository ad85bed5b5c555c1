"""Logs: one MCAP file for a run or a pair of runs, written and read."""

from cranectl.log.reader import read_log
from cranectl.log.writer import check_writable, write_log

__all__ = ["check_writable", "read_log", "write_log"]
