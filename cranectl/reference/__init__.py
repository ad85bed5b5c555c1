"""What the load is asked to do: time laws, paths, trajectories; planned in minimum time, or from files."""

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
    "load_scenario",
    "planned",
    "time_law",
]
