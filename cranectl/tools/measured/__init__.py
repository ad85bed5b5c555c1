"""Measured cranes: import their logs, check them against physics, and predict them with the plants."""
