"""What the load is asked to do: time laws, paths, trajectories; from files, by hand."""

from cranectl.reference.time_laws import REST_DERIVATIVES, time_law
from cranectl.reference.trajectory import HoldPath, Trajectory, build_trajectory, end_point

__all__ = ["REST_DERIVATIVES", "HoldPath", "Trajectory", "build_trajectory", "end_point", "time_law"]
