"""The load's reference: time laws, paths and trajectories, computed, read from files or driven by hand."""

from cranectl.reference.time_laws import REST_DERIVATIVES, time_law
from cranectl.reference.trajectory import HoldPath, Trajectory, build_trajectory, end_point

__all__ = ["REST_DERIVATIVES", "HoldPath", "Trajectory", "build_trajectory", "end_point", "time_law"]
