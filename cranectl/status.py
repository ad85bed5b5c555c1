"""Define the status of a run, for kernels, loops, logs and exit codes."""

from enum import IntEnum


class RunStatus(IntEnum):
    """Status of a run at one sample; a run with SLACK_ROPE or a later one stopped early."""

    RUNNING = 0
    COMPLETED = 1
    SLACK_ROPE = 2
    ANGLE_SINGULAR = 3
    LENGTH_SINGULAR = 4
    NON_FINITE = 5
    ENGINE_WARNING = 6
    WORKSPACE_LEFT = 7
    INTERRUPTED = 8
    CONTROLLER_FAILED = 9

    @property
    def stopped(self) -> bool:
        """Whether the run ended before its scenario did."""
        return self >= RunStatus.SLACK_ROPE

    @property
    def label(self) -> str:
        """The name in tables and JSON, such as `slack-rope`."""
        return self.name.lower().replace("_", "-")

    @property
    def explanation(self) -> str:
        """One sentence that explains the status."""
        return _EXPLANATION[self]


_EXPLANATION = {
    RunStatus.RUNNING: "the run is under way",
    RunStatus.COMPLETED: "the run reached its end",
    RunStatus.SLACK_ROPE: "the rope went slack, in the plant or as the tracker sees it",
    RunStatus.ANGLE_SINGULAR: "a cardan angle left (-pi/2, pi/2)",
    RunStatus.LENGTH_SINGULAR: "the rope length is not positive",
    RunStatus.NON_FINITE: "a state became infinite or not a number",
    RunStatus.ENGINE_WARNING: "the physics engine reported a numerical warning",
    RunStatus.WORKSPACE_LEFT: "bridge, trolley or rope left the workspace",
    RunStatus.INTERRUPTED: "the run was interrupted",
    RunStatus.CONTROLLER_FAILED: "the controller said that it cannot go on, or commanded no number",
}
