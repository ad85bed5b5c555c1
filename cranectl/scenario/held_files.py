"""What belongs to a scenario but is in no table of it: files of its segments, and claims of its plan."""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from cranectl.scenario.segments import Segment, Spline
from cranectl.support import JSON, File

FOLDER = "reference"
PLAN = f"{FOLDER}/plan.json"  # claims of planned segments, by index
DIGEST_DIGITS = 12  # of a SHA-256


def files_of(segments: Sequence[Segment]) -> dict[str, bytes]:
    """Return the contents of the files of segments and their claims, by unique names."""
    claims = {str(k): segment.claim for k, segment in enumerate(segments) if segment.claim}
    splines = [segment for segment in segments if isinstance(segment, Spline)]
    files = {_name(spline): spline.held for spline in splines if spline.held}
    return {**files, PLAN: json.dumps(claims).encode()} if claims else files


def with_files(segments: Sequence[Segment], files: Mapping[str, bytes]) -> tuple[Segment, ...]:
    """Return the segments with their files and claims, as `files_of` returned them.

    Raises InputError for claims that are not JSON.
    """
    claims = JSON.parse(files[PLAN], PLAN) if PLAN in files else {}
    known_claims = claims if isinstance(claims, dict) else {}
    complete: list[Segment] = []
    for k, segment in enumerate(segments):
        if isinstance(claim := known_claims.get(str(k)), str):
            segment = segment.claiming(claim)
        if isinstance(segment, Spline) and _name(segment) in files:
            segment = segment.holding(files[_name(segment)])
        complete.append(segment)
    return tuple(complete)


def _name(spline: Spline) -> str:
    return f"{FOLDER}/{spline.source.held[:DIGEST_DIGITS]}-{spline.source.file}" if spline.source else ""


@dataclass(frozen=True)
class HeldFiles:
    """The files of `Scenario.held_files`, kept in a directory beside the table of the scenario."""

    directory: Path  # that names of files are relative to

    def write(self, files: Mapping[str, bytes]) -> None:
        """Write `files` into the directory; raise OSError."""
        folder = self.directory / FOLDER
        for name, content in files.items():
            folder.mkdir(exist_ok=True)
            with File(folder / Path(name).name).replacing() as part:
                part.write_bytes(content)

    def read(self) -> dict[str, bytes]:
        """Return the files for `Scenario.with_files`; leave out unreadable ones."""
        contents = {}
        for path in self._paths:
            with suppress(OSError):
                contents[f"{FOLDER}/{path.name}"] = path.read_bytes()
        return contents

    def remove(self) -> None:
        """Remove the files."""
        for path in self._paths:
            path.unlink()
        with suppress(OSError):  # the folder does not exist, or has other files
            (self.directory / FOLDER).rmdir()

    @property
    def _paths(self) -> list[Path]:
        paths = (self.directory / FOLDER).glob(f"{'[0-9a-f]' * DIGEST_DIGITS}-*")
        return sorted(path for path in (*paths, self.directory / PLAN) if path.is_file())
