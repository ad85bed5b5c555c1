"""Where logs lie by default."""

from pathlib import Path

from cranectl.scenario import Scenario

LOG_DIRECTORY = Path("logs")


def default_log(directory: Path, scenario: Scenario, controller: str, drive: str) -> Path:
    """`DIRECTORY/SCENARIO/CONTROLLER-DRIVE.mcap`."""
    return directory / scenario.name / f"{controller}-{drive}.mcap"
