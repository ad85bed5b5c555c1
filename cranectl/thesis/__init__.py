"""The thesis behind cranectl: its tables computed again, and its figures."""
