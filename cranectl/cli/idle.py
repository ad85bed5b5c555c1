"""Lines on settings and options that a user gave and that change nothing in what a command does."""

import re
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from cranectl import scenario as scenario_files
from cranectl import simulate
from cranectl.cli.output import Screen
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.plants import PLANTS
from cranectl.support import InputError

if TYPE_CHECKING:
    from cranectl.plants import Drive
    from cranectl.scenario import Scenario

SHOWN_NAMES = 8  # names in a line, and lines
LABELS = ("name", "title", "controller.name")  # told where they are shown


class IdleSettings:
    """Settings and options that a user gave and that change nothing in what a command does."""

    # What no command reads that keeps no log and judges nothing.
    OF_RUNS = ("log.*", "limits.*", "expected")
    # What no command reads besides that judges a design where the load hangs or at given operating points.
    OF_MOTIONS = (
        "reference.*", "duration", "planning.*", "obstacles.*", "initial.*", "disturbances.*", "workspace.*",
        "metrics.*", "rig.look.*",
    )  # fmt: skip

    @staticmethod
    def print(screen: Screen, lines: Sequence[str]) -> None:
        """Print what `lines` and `timeout_lines` say, as much as is read."""
        for line in lines[:SHOWN_NAMES]:
            screen.print(Screen.styled(f"  {line}", "yellow"))
        if len(lines) > SHOWN_NAMES:
            screen.print(f"  and {len(lines) - SHOWN_NAMES} more settings that change nothing")

    @staticmethod
    def lines(
        scenario: "Scenario",
        request: ScenarioRequest,
        uses: Iterable[tuple[str, "Drive", str]],
        *,
        unread: Sequence[str] = (),
        all_effects: bool = False,
    ) -> list[str]:
        """Say what of the settings that the user gave changes nothing, a line for each reason.

        `scenario` is planned, `uses` has plant, drive and controller of each run. `unread` has shell patterns
        of settings that the command does not read: it says so of options only, since a file is for every
        command. With `all_effects` the command takes numbers of the rig for effects that the scenario does
        not have.
        """
        stated = [name for name in scenario_files.ScenarioFile.given_settings(*request) if name not in LABELS]
        if not stated:
            return []
        keys = [override.partition("=")[0].strip() for override in request.overrides]
        options = [*keys, *(f"{key}.*" for key in keys)]
        read = [name for name in stated if not _fits(name, unread)]
        reasons = {"the command does not read it": [n for n in stated if n not in read and _fits(n, options)]}
        runs = [simulate.RunKind(*use) for use in uses]
        for why, names in simulate.RunKind.find_idle_settings(scenario, request.read(), read, runs).items():
            reasons.setdefault(why, []).extend(names)
        lines = [
            f"{scenario.name}: {_listed(names)} nothing here: {why}"
            for why, names in reasons.items()
            if names
        ]
        effects = () if all_effects else scenario.idle_effects(read)
        if any(PLANTS.entry(run.plant).is_model_file for run in runs):
            effects = tuple(name for name in effects if name != "limits")  # those of a model act in it
        return [*([_effects_line(scenario, effects, runs)] if effects else []), *lines]

    @staticmethod
    def print_in_analysis(
        screen: Screen,
        scenario: "Scenario",
        request: ScenarioRequest,
        controllers: Iterable[str],
        *,
        plant: str = "mujoco",
        drive: "Drive" = "velocity",
        with_model: bool = False,
        unread: Sequence[str] = OF_RUNS,
    ) -> None:
        """Print what changes nothing in a command that takes the effects of a rig and keeps no log.

        `with_model` says that it runs the model file of the rig too.
        """
        uses = [(plant, drive, controller) for controller in controllers]
        if with_model and scenario.rig.model is not None:
            entry = PLANTS.find(scenario.rig.model, scenario.rig)
            uses += [(entry.name, entry.drives[0], controller) for _, _, controller in uses]
        lines = IdleSettings.lines(scenario, request, uses, unread=unread, all_effects=True)
        IdleSettings.print(screen, lines)

    @staticmethod
    def timeout_lines(controllers: Iterable[str], timeout: float, *, cluster: bool = False) -> list[str]:
        """Say why `--timeout`, where it is given, changes nothing for these controllers."""
        if timeout == simulate.Loop.TIMEOUT:
            return []
        if cluster:
            return ["--timeout changes nothing here: it is for runs of this machine"]
        is_used = any(name in ALL_CONTROLLERS.opened.files for name in controllers)
        return [] if is_used else ["--timeout changes nothing here: no controller is from a file"]


def _fits(name: str, patterns: Iterable[str]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def _effects_line(scenario: "Scenario", idle: Sequence[str], uses: Iterable["simulate.RunKind"]) -> str:
    """Say which numbers of the rig no run uses, and the options that add their effects."""
    options = ""
    added = scenario.effects.model_copy(update={name: getattr(scenario.rig.effects, name) for name in idle})
    try:
        for use in uses:
            PLANTS.entry(use.plant).check_effects(added, use.drive)
    except InputError:
        options = "--drive velocity --plants elastic,mujoco "
    tables = ", ".join(f"[effects.{name}]" for name in idle)
    settings = " ".join(f"--set effects.{name}={{}}" for name in idle)
    return f"{scenario.name}: {tables} of the rig do not act in this run: to add them, {options}{settings}"


def _listed(names: Iterable[str]) -> str:
    """Return the names of settings as a subject with its verb, a list by its own name and once."""
    whole = list(dict.fromkeys(re.sub(r"(\.\d+)+$", "", name) for name in names))
    listed = ", ".join(whole[:SHOWN_NAMES]) + (
        f" and {len(whole) - SHOWN_NAMES} more" if len(whole) > SHOWN_NAMES else ""
    )
    return f"{listed} {'changes' if len(whole) == 1 else 'change'}"
