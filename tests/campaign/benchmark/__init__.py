"""The benchmark: rules, pieces, scores, tuning, commands."""
