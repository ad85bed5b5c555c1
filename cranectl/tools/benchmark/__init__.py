"""The benchmark: every controller runs the same campaigns on scenarios, sets of cranes and plants."""
