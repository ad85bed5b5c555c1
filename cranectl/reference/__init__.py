"""What the load is asked to do: time laws, paths, trajectories; planned, from files, by hand."""

from cranectl.reference.hand_limits import hand_limits
from cranectl.reference.load import load_scenario, planned
from cranectl.reference.paths import ArcPath, HoldPath, LinePath, Path
from cranectl.reference.time_laws import REST_DERIVATIVES, time_law
from cranectl.reference.trajectory import Trajectory, build_trajectory, end_point

__all__ = [
    "REST_DERIVATIVES",
    "ArcPath",
    "HoldPath",
    "LinePath",
    "Path",
    "Trajectory",
    "build_trajectory",
    "end_point",
    "hand_limits",
    "load_scenario",
    "planned",
    "time_law",
]
