"""The thesis that this came from: its tables computed anew, its diagrams."""
