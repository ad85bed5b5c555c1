"""Bounds of numbers that a user chooses and that work or memory grow with."""

MAX_RUNS = 1_000_000  # of a campaign, or of the search for a controller's numbers
MAX_DRAWS = 100_000  # cranes of a set of a benchmark
