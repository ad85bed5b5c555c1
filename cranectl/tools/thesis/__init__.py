"""Reproduce the tables and figures of the thesis behind cranectl."""
