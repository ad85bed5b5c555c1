"""Bounds of numbers that a user chooses and that work or memory grow with."""

MAX_RUNS = 1_000_000  # of a campaign, or of the search for a controller's numbers
MAX_DRAWS = 100_000  # cranes of a set of a benchmark
MAX_WORKERS = 1024  # threads or processes
MAX_REPLAYS = 1000  # logs of a campaign's worst runs
MAX_CRANES = 100_000  # that a program steps together
MAX_OPERATING_POINTS = 2000  # operating points of a certificate
MAX_PLANNED = 200  # segments of a scenario whose timing is planned
MAX_SEED = 2**63 - 1
MAX_PORT = 2**16 - 1
