"""What foreign code declares, asked in a program of its own: whatever it does ends that program only."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

PATIENCE = 10.0  # [s] for an answer


def answer(program: str, binary: Path, question: dict[str, Any]) -> dict[str, Any]:
    """What the Python file `program` says of `binary`; raises ValueError with what is wrong with it."""
    command = [sys.executable, "-I", program, str(binary)]
    try:
        done = subprocess.run(
            command,
            input=json.dumps(question),
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"gives no answer within {PATIENCE:g} s") from None
    try:
        told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        how = signal.Signals(-done.returncode).name if done.returncode < 0 else f"exit code {done.returncode}"
        raise ValueError(f"ended the process that asked it what it declares, with {how}") from None
    if "error" in told:
        raise ValueError(told["error"])
    return told
