"""The benchmark: controllers on scenarios, sets of cranes and plants, each a campaign on the same draws."""
