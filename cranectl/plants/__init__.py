"""The plants: independent models of the same crane behind one interface."""
