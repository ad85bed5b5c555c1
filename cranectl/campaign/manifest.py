"""The manifest of a campaign: what campaign.json stores, enough to resume it and to repeat any of its runs.

The manifest lists the software that began the result, and other software that was accepted later. Each part
carries the identity of the software that made it.
"""

import hashlib
import json
import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict, ValidationError

from cranectl.campaign.definition import Campaign, parameters_of
from cranectl.campaign.settings import CampaignSettings
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.loaders import file_from
from cranectl.plants import PLANTS, PlantEntry
from cranectl.scenario import MetricSettings, RigParameters, Scenario, without_file_names
from cranectl.support import InputError, Provenance, Table, Tree

FORMAT = 3
RULE = 1  # version of the identities
DEFAULT_METRICS = MetricSettings().model_dump(mode="json")
DEFAULT_RIG = RigParameters().model_dump(mode="json")
SERVOS = "servos"  # the present velocity drives of the analytic plant
# Keys of a campaign that change no row, or only name the scenario, which is stored whole.
NOT_DECISIVE = ("title", "limits", "scenario", "rig", "set")
SPENT = ("limits", "planning", "obstacles")  # tables of a scenario that change no run of its stored reference


class _Shape(BaseModel):
    """A part of a manifest: what is read of it before the classes of settings check the rest."""

    model_config = ConfigDict(strict=True, extra="allow")


class _Campaign(_Shape):
    name: str


class _Model(_Shape):
    file: str
    __pydantic_extra__: dict[str, str]  # label, colour, ... of the plant


class _Segment(_Shape):
    source: dict[str, Any] | None = None
    made_from: dict[str, Any] = {}


class _Reference(_Shape):
    segments: list[_Segment]


class _Scenario(_Shape):
    rig: dict[str, Any]
    reference: _Reference
    disturbances: list[dict[str, Any]]


class _Manifest(_Shape):
    campaign: _Campaign
    runs: int
    scenario: _Scenario
    versions: dict[str, str]
    accepted: list[dict[str, str]]
    models: dict[str, _Model] = {}


class SoftwareOrigin(NamedTuple):
    """The software that made parts of a result."""

    identity: str  # digest that these parts carry
    versions: Mapping[str, str]  # of packages, and fingerprints of sources


class Manifest:
    """The manifest of a result: what was run, and by which software."""

    @staticmethod
    def software(plants: Iterable[str], controllers: Iterable[str]) -> dict[str, str]:
        """Return the versions of installed software: cranectl, registered modules, controller files."""
        own = (
            PLANTS.sources(plants)
            | ALL_CONTROLLERS.sources(controllers)
            | ALL_CONTROLLERS.digests(controllers)
        )
        return Provenance.now() | own

    @staticmethod
    def changes_of_software(
        versions: Mapping[str, str], plants: Iterable[str], controllers: Iterable[str]
    ) -> tuple[str, ...]:
        """Return a phrase for each difference of the installed software from `versions`.

        Controllers and models from files that this process has not read are left out: it cannot tell whether
        they changed.
        """
        installed = Manifest.software(plants, controllers)
        comparable = {
            name: version
            for name, version in versions.items()
            if not name.startswith(("law ", "model ")) or name in installed
        }
        return tuple(Provenance.differences(comparable, installed))

    @staticmethod
    def of(campaign: Campaign) -> Table:
        """Return everything that decides the runs of `campaign`, as plain data."""
        table = {
            "format": FORMAT,
            "campaign": campaign.settings.model_dump(mode="json"),
            "runs": campaign.runs,
            "scenario": campaign.nominal.model_dump(mode="json"),
            "versions": Manifest.software(campaign.settings.plants, campaign.settings.controllers),
            "accepted": [],
        }
        models = [entry for name, entry in PLANTS.model_files.items() if name in campaign.settings.plants]
        if models:
            table["models"] = {
                entry.name: {"file": entry.arguments["file"], **entry.declared} for entry in models
            }
        plain: Table = json.loads(json.dumps(table))
        return plain | ({"velocity_drives": SERVOS} if _has_analytic_drives(plain["campaign"]) else {})

    @staticmethod
    def start_facts(campaign: Campaign, directory: Path, command: Sequence[str]) -> Table:
        """Return the command that starts a result, and its files of controllers relative to `directory`.

        They only help to resume the result and decide no number. JSON cannot hold a command that is not
        UTF-8, so such a command is left out.
        """
        opened = [name for name in campaign.settings.controllers if name in ALL_CONTROLLERS.opened.files]
        files = {name: file_from(name, directory) for name in opened}
        is_text = all(word.encode(errors="replace").decode() == word for word in command)
        return {**({"command": list(command)} if is_text else {}), **({"files": files} if files else {})}

    @staticmethod
    def resume_command(manifest: Mapping[str, Any]) -> str:
        """Return the command line that resumes a result; empty if the manifest does not have its command."""
        words = manifest.get("command")
        if not isinstance(words, list) or not words or not all(isinstance(word, str) for word in words):
            return ""
        arguments = [word for word in words if word not in ("--overwrite", "--resume")]
        return shlex.join(["cranectl", *arguments, "--resume"])

    @staticmethod
    def controller(manifest: Mapping[str, Any], directory: Path, name: str) -> str:
        """Return the value of `--controller` that selects controller `name` of the result in `directory`."""
        files = manifest.get("files")
        file = files.get(name) if isinstance(files, dict) else None
        if not isinstance(file, str):
            return name
        return file if file.startswith(ALL_CONTROLLERS.UDP) else os.path.normpath(directory / file)

    @staticmethod
    def checked(data: Any, source: str) -> Table:
        """Return the manifest `data`; raise InputError if it is none, or one of another format."""
        number = data.get("format") if isinstance(data, dict) else None
        wrong = ""
        if number == FORMAT:
            try:
                _Manifest.model_validate(data)
            except ValidationError as error:
                wrong = ".".join(str(key) for key in error.errors()[0]["loc"])
            else:
                manifest: Table = data
                return manifest
        other = type(number) is int and number != FORMAT
        raise InputError(
            f"{source} has format {number}"
            if other
            else f"{source} is not the manifest of a campaign" + (f": {wrong} is wrong" if wrong else ""),
            allowed=f"a result of format {FORMAT}",
            remedy="read it with the version of cranectl that wrote it, or run the campaign again"
            if other
            else "check the path, or run the campaign again",
        )

    @staticmethod
    def campaign(manifest: Mapping[str, Any], source: str) -> Campaign:
        """Make the campaign from `manifest` alone: the file of its scenario may have changed since."""
        Manifest.open_models(manifest)
        settings = CampaignSettings.parse(manifest["campaign"], source)
        nominal = Scenario.from_table(manifest["scenario"], source)
        return Campaign(settings, nominal, parameters_of(settings, nominal), manifest["runs"])

    @staticmethod
    def open_models(manifest: Mapping[str, Any]) -> None:
        """Open the model files of a campaign's plants, or remember only names where there are no files."""
        for name, declared in manifest.get("models", {}).items():
            rig = RigParameters.from_table(manifest["scenario"]["rig"], "the rig of the campaign")
            try:
                PLANTS.find(declared["file"] if name not in PLANTS else name, rig)
            except InputError:
                PLANTS.remember(
                    PlantEntry.from_declared(name, declared, batch=PLANTS[PLANTS.REFERENCE].batch)
                )

    @staticmethod
    def origins(manifest: Mapping[str, Any]) -> list[SoftwareOrigin]:
        """Return all software that may have made parts of the result, that of its start first."""
        return [
            Manifest.origin(manifest, versions) for versions in (manifest["versions"], *manifest["accepted"])
        ]

    @staticmethod
    def origin(manifest: Mapping[str, Any], versions: Mapping[str, str]) -> SoftwareOrigin:
        """Return the origin of parts made by `versions`, with a digest of all that decides numbers."""
        software = {name: version for name, version in versions.items() if name not in Provenance.HARMLESS}
        text = json.dumps({**_decisive(manifest), "format": RULE, "versions": software}, sort_keys=True)
        return SoftwareOrigin(hashlib.sha256(text.encode()).hexdigest()[:16], versions)

    @staticmethod
    def differences(manifest: Mapping[str, Any], expected: Mapping[str, Any]) -> list[str]:
        """Return how two campaigns differ, a short phrase for each value, without their software."""
        different = Tree(_decisive(manifest)).differences(_decisive(expected), absent="absent")
        return [f"{name} is {_short(a)}, not {_short(b)}" for name, a, b in different]


def _has_analytic_drives(campaign: Mapping[str, Any]) -> bool:
    return campaign["drive"] == "velocity" and "analytic" in campaign["plants"]


def _decisive(manifest: Mapping[str, Any]) -> Table:
    campaign = {key: value for key, value in manifest["campaign"].items() if key not in NOT_DECISIVE}
    scenario = without_file_names(manifest["scenario"])
    scenario = {key: value for key, value in scenario.items() if key not in SPENT}
    # Leave out defaults of keys that older results lack, so that their identities stay the same.
    if campaign.get("spread") == 1.0:
        del campaign["spread"]
    if scenario.get("metrics") == DEFAULT_METRICS:
        del scenario["metrics"]
    defaults = {name: DEFAULT_RIG[name] for name in ("rated_load", "effects", "look")}
    scenario["rig"] = {k: v for k, v in scenario["rig"].items() if k not in defaults or v != defaults[k]}
    scenario["disturbances"] = [
        {key: value for key, value in step.items() if key != "force" or value is not None}
        for step in scenario["disturbances"]
    ]
    drives = {key: manifest[key] for key in ("velocity_drives",) if key in manifest}
    return {"campaign": campaign, "runs": manifest["runs"], "scenario": scenario, **drives}


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
