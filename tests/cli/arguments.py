"""Options of `run fixed-position` that make the run short, or make it stop early."""

SHORT = ["--set", "duration=0.5", "--set", "disturbances.0.start=0.1", "--set", "disturbances.1.start=0.2"]
STOP = ["--set", "disturbances=[{joint='alpha', start=0.1, magnitude=20.0}]", "--set", "duration=2"]
