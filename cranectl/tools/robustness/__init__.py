"""Measure and certify the effect of the differences between a rig and its design model."""
