"""Logs: one MCAP file for a run or those of several plants, written, read and described."""
