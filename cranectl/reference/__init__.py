"""Desired load trajectories: time laws, path segments, their composition."""

from cranectl.reference.trajectory import Trajectory, build_trajectory

__all__ = ["Trajectory", "build_trajectory"]
