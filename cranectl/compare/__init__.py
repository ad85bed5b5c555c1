"""Runs against each other: plants, golden logs, merged logs, and the limits of all that."""
