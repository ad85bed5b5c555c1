"""Which signal group goes to which topic."""

import functools

from cranectl.signals import LOAD, STATE, Signal, SignalGroup

REFERENCE_LOAD = "/reference/load"
DESIGN = "/controller/design"
RUN_INFO = "/run/info"
LOG = "/log"
TRANSFORMS = "/tf"
REFERENCE_PATH = "/reference/path"
WORKSPACE = "/rig/workspace"

# What is compared with the reference plant sample by sample.
DIFFERENCE_GROUPS = (
    SignalGroup("state", "StateDifference", "reference plant minus another", STATE.signals),
    SignalGroup("load", "LoadDifference", "reference plant minus another", LOAD.signals),
)

DIFFERENCES = "/diff/"
VERDICT = "verdict"
DISTANCE = SignalGroup(
    "distance",
    "Distance",
    "how far the plants are apart",
    (
        Signal("load_distance", "|Δz|", "m", "distance of the loads"),
        Signal("angle_distance", "max |Δα|, |Δβ|", "rad", "larger difference of the angles"),
    ),
)


def plant_topic(plant: str, group: str) -> str:
    """Topic of a plant's group; always prefixed, so that files of different plants overlay."""
    return f"/{plant}/{group}"


def difference_topic(group: str, plant: str = "") -> str:
    """Topic of the difference from the reference plant; of `plant`, where a log has several others."""
    return f"{DIFFERENCES}{plant}/{group}" if plant else f"{DIFFERENCES}{group}"


@functools.cache
def units(group: SignalGroup) -> dict[str, str]:
    """Channel metadata: what each field is and its unit."""
    return {s.name: f"{s.symbol} [{s.unit}] {s.description}" for s in group.signals}
