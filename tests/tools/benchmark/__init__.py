"""The benchmark: rules, trials, scores, tuning, commands."""
