"""What travels with a scenario but in no table of it: files of its segments, claims of its plan."""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from cranectl.scenario.along_path import Plannable
from cranectl.scenario.scenario import Scenario
from cranectl.scenario.segments import Segment, Spline
from cranectl.support.documents import parse_json
from cranectl.support.files import replacing

FOLDER = "reference"
PLAN = f"{FOLDER}/plan.json"  # by the index of a planned segment what it was proven to keep
DIGEST_DIGITS = 12  # of a SHA-256


def held_files(scenario: Scenario) -> dict[str, bytes]:
    """By a name that no other file has: what a log attaches."""
    segments = enumerate(scenario.reference.segments)
    claims = {str(k): each.claim for k, each in segments if isinstance(each, Plannable) and each.claim}
    splines = [each for each in scenario.reference.segments if isinstance(each, Spline)]
    files = {_name(spline): spline.held for spline in splines if spline.held}
    return {**files, PLAN: json.dumps(claims).encode()} if claims else files


def with_files(scenario: Scenario, files: Mapping[str, bytes]) -> Scenario:
    """Return the scenario, read from a table, with those of `files` that `held_files` had of it.

    Raises InputError for claims that are no JSON.
    """
    if not files:
        return scenario
    claims = parse_json(files[PLAN], PLAN) if PLAN in files else {}
    told = claims if isinstance(claims, dict) else {}
    segments = tuple(
        _with_file(each, files, told.get(str(k))) for k, each in enumerate(scenario.reference.segments)
    )
    reference = scenario.reference.model_copy(update={"segments": segments})
    return scenario.model_copy(update={"reference": reference})


def _with_file(segment: Segment, files: Mapping[str, bytes], claim: object) -> Segment:
    if isinstance(segment, Plannable) and isinstance(claim, str):
        segment = segment.claiming(claim)
    if isinstance(segment, Spline) and _name(segment) in files:
        return segment.holding(files[_name(segment)])
    return segment


def put_files(directory: Path, scenario: Scenario) -> None:
    """Write them into `directory`, beside a table of the scenario; raises OSError."""
    for name, content in held_files(scenario).items():
        (directory / FOLDER).mkdir(exist_ok=True)
        with replacing(directory / FOLDER / Path(name).name) as part:
            part.write_bytes(content)


def files_in(directory: Path) -> dict[str, bytes]:
    """What `put_files` has written, as `with_files` takes it; what cannot be read is left out."""
    found = {}
    for path in _files(directory):
        with suppress(OSError):
            found[f"{FOLDER}/{path.name}"] = path.read_bytes()
    return found


def remove_files(directory: Path) -> None:
    """Remove what `put_files` has written."""
    for path in _files(directory):
        path.unlink()
    with suppress(OSError):  # it is not there, or holds something else
        (directory / FOLDER).rmdir()


def _files(directory: Path) -> list[Path]:
    held = (directory / FOLDER).glob(f"{'[0-9a-f]' * DIGEST_DIGITS}-*")
    return sorted(path for path in (*held, directory / PLAN) if path.is_file())


def _name(spline: Spline) -> str:
    return f"{FOLDER}/{spline.source.held[:DIGEST_DIGITS]}-{spline.source.file}" if spline.source else ""
