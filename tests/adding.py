"""Files of the package with something added, in a folder of their own that goes before the package."""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1] / "cranectl"
FINDER = """\
import sys
from importlib.abc import MetaPathFinder
from importlib.util import spec_from_file_location
from pathlib import Path

class Added(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        file = Path(FOLDER, *name.split(".")).with_suffix(".py")
        return spec_from_file_location(name, file) if file.is_file() else None

sys.meta_path.insert(0, Added())
"""


def run_with(folder: Path, added: Mapping[str, Mapping[str, str]], script: str) -> Any:
    """Run `script` where files of the package have what is `added`, and return the JSON that it prints last.

    `added` has by file, and by a text that stands there once, what follows on that text.
    """
    for name, texts in added.items():
        source = (PACKAGE / name).read_text()
        for text, more in texts.items():
            assert source.count(text) == 1, f"{name} has {source.count(text)} times {text!r}"
            source = source.replace(text, text + more)
        file = folder / "cranectl" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(source)
    whole = FINDER.replace("FOLDER", repr(str(folder))) + script
    done = subprocess.run(
        [sys.executable, "-c", whole], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])
