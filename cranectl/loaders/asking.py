"""What foreign code declares, asked in a program of its own: whatever it does ends that program only."""

import json
import sys
from pathlib import Path
from typing import Any

from cranectl.support.children import answer_of_program, describe_exit

DECLARATION_TIMEOUT = 600.0  # [s] for an answer, without waiting for a processor: it only ends what hangs


def answer(program: str, binary: Path, question: dict[str, Any]) -> dict[str, Any]:
    """What the Python file `program` says of `binary`; raises ValueError with what is wrong with it."""
    command = [sys.executable, "-I", program, str(binary)]
    try:
        code, out, _ = answer_of_program(command, DECLARATION_TIMEOUT, question=json.dumps(question))
    except TimeoutError:
        raise ValueError(f"gives no answer within {DECLARATION_TIMEOUT:g} s") from None
    try:
        told: dict[str, Any] = json.loads(out)
    except ValueError:
        how = describe_exit(code)
        raise ValueError(f"ended the process that asked it what it declares, with {how}") from None
    if "error" in told:
        raise ValueError(told["error"])
    return told
