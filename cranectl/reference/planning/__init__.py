"""Motions in minimum time within limits that are proven at all times."""
