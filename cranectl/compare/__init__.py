"""Compare runs: plants with each other, runs with golden logs, and the limits of their differences."""
