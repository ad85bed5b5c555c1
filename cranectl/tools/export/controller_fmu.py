"""Export a controller as an FMU: its C code behind the functions of FMI, and a table for `--controller`."""

import json
from typing import NamedTuple

from cranectl.controllers import JOINTS
from cranectl.plants import DRIVES
from cranectl.scenario import NANOSECONDS
from cranectl.signals import SignalGroup
from cranectl.support import InputError
from cranectl.tools.export.description import FmuVariable
from cranectl.tools.export.fmu import Model, filled, fmu_archive
from cranectl.tools.export.package import controller_sources
from cranectl.tools.export.plant import DRIVEN
from cranectl.tools.export.prepared import Exported
from cranectl.tools.export.sample import KEPT

FAILURE = (
    "2 the rope is slack, 3 an angle or 4 its length is singular, 5 a number or 9 a command is not finite"
)
TABLE_BEGINS = "# Read by cranectl beside the FMU: what FMI has no place for.\n"


class ControllerFmu(NamedTuple):
    """An exported FMU, and the table with which `--controller` reads it."""

    archive: bytes
    table: str


def controller_fmu(exported: Exported, fmi: int = 2) -> ControllerFmu:
    """Return a controller as an FMU for co-simulation, whose step is the control period.

    Parameters
    ----------
    exported : Exported
        The controller, from `prepare_export`.
    fmi : int
        Version of FMI, 2 or 3.

    Returns
    -------
    ControllerFmu
        The content of the FMU and of the TOML file beside it.

    Raises
    ------
    InputError
        If the controller uses what the translation does not know, or needs rows of the reference to come;
        also as `fmu_archive`.
    """
    if exported.controller.preview:
        raise InputError(
            f"{exported.design.name} needs {exported.controller.preview} rows of the reference ahead of time",
            allowed="as an FMU, a controller that needs the present row alone",
            remedy="export it as C, to a directory",
        )
    measured, reference = exported.inputs[0]
    state = SignalGroup.STATE.signals
    group, signals = ("encoders", state[::2]) if len(measured) == JOINTS else ("state", state)
    groups = ((group, signals, measured), ("reference", SignalGroup.REFERENCE.signals, reference))
    inputs = [
        FmuVariable.of_signal(f"{kind}.{signal.name}", "input", signal, float(start))
        for kind, signals, starts in groups
        for signal, start in zip(signals, starts, strict=True)
    ]
    command = DRIVES[exported.drive].command
    outputs = [
        FmuVariable.of_signal(f"command.{axis}", "output", signal)._replace(discrete=True)
        for axis, signal in zip(DRIVEN, SignalGroup.command(command).signals, strict=False)
    ]
    values = {
        "STEM": exported.stem,
        "SYMBOL": exported.symbol,
        "REFERENCE": len(measured),
        "COMMAND": len(inputs),
        "PREVIOUS": KEPT.previous,
    }
    model = Model(
        name=exported.slug.replace("-", "_"),
        title=f"the controller {exported.design.name} for {exported.drive} drives",
        variables=(*inputs, *outputs),
        period=exported.scenario.period_ns / NANOSECONDS,
        memory=len(exported.sample.memory),
        sources={**controller_sources(exported), "model.c": filled("fmi/controller.c.txt", values)},
        failure=FAILURE,
    )
    table = {"name": exported.slug, "command": command, "follows": exported.controller.follows}
    lines = [TABLE_BEGINS, *(f"{key} = {json.dumps(value)}\n" for key, value in table.items())]
    return ControllerFmu(fmu_archive(model, fmi), "".join(lines))
