"""The files that segments of a scenario were made from: they travel with it, but in no table of it."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from cranectl.scenario.scenario import Scenario
from cranectl.scenario.segments import Spline
from cranectl.support.files import replacing

FOLDER = "reference"
DIGITS = 12  # of a SHA-256


def held_files(scenario: Scenario) -> dict[str, bytes]:
    """By a name that no other file has: what a log attaches."""
    splines = [each for each in scenario.reference.segments if isinstance(each, Spline)]
    return {_name(spline): spline.held for spline in splines if spline.held}


def with_files(scenario: Scenario, files: Mapping[str, bytes]) -> Scenario:
    """The scenario, read from a table, with those of `files`, by the names above, that it was made from."""
    if not files:
        return scenario
    segments = tuple(
        each.holding(files[_name(each)]) if isinstance(each, Spline) and _name(each) in files else each
        for each in scenario.reference.segments
    )
    reference = scenario.reference.model_copy(update={"segments": segments})
    return scenario.model_copy(update={"reference": reference})


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
    return sorted(path for path in (directory / FOLDER).glob(f"{'[0-9a-f]' * DIGITS}-*") if path.is_file())


def _name(spline: Spline) -> str:
    return f"{FOLDER}/{spline.source.held[:DIGITS]}-{spline.source.file}" if spline.source else ""
