"""Run a script with a modified copy of some files of the package, which the import system finds first.

The script may use `call` to run commands.
"""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1] / "cranectl"
PREAMBLE = '''\
import sys
from importlib.abc import MetaPathFinder
from importlib.util import spec_from_file_location
from pathlib import Path

class ModifiedFileFinder(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        file = Path(FOLDER, *name.split(".")).with_suffix(".py")
        return spec_from_file_location(name, file) if file.is_file() else None

sys.meta_path.insert(0, ModifiedFileFinder())

def call(*arguments):
    """Run a command of cranectl; return its exit code and its output."""
    import contextlib, io
    from cranectl.cli.main import main
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        code = main(list(arguments))
    return code, output.getvalue()
'''


def run_with(folder: Path, additions: Mapping[str, Mapping[str, str]], script: str) -> Any:
    """Run `script` with additions to files of the package, and return the JSON that it prints last.

    `additions` maps a file to a mapping from a text, which occurs once in the file, to the text that is
    inserted after it.
    """
    for name, insertions in additions.items():
        source = (PACKAGE / name).read_text()
        for text, insertion in insertions.items():
            assert source.count(text) == 1, f"{name} contains {text!r} {source.count(text)} times"
            source = source.replace(text, text + insertion)
        file = folder / "cranectl" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(source)
    code = PREAMBLE.replace("FOLDER", repr(str(folder))) + script
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout.splitlines()[-1])
