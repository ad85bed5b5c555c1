"""Ask foreign code in a separate process what it declares, so that a crash ends only that process.

The process runs this file: `python declaration_process.py PROGRAM BINARY` reads the question as one line of
JSON. It calls `answer` of the file PROGRAM and writes the result as JSON. To start fast, it imports nothing
of the package.
"""

import json
import os
import runpy
import sys
from pathlib import Path
from typing import Any

DECLARATION_TIMEOUT = 600.0  # [s] for an answer, without waiting for a processor: it only ends what hangs


def ask_declaration(program: str, binary: Path, question: dict[str, Any]) -> dict[str, Any]:
    """Return what `answer(binary, question)` of the file `program` returns; raise ValueError as it does."""
    from cranectl.support import Program  # which the process does without

    command = [sys.executable, "-I", __file__, program, str(binary)]  # -I: no variables of the user
    try:
        done = Program.ask(command, DECLARATION_TIMEOUT, question=json.dumps(question))
    except TimeoutError:
        raise ValueError(f"gives no answer within {DECLARATION_TIMEOUT:g} s") from None
    try:
        answer: dict[str, Any] = json.loads(done.output)
    except ValueError:
        raise ValueError(f"ended the process that asked it what it declares, with {done.end}") from None
    if "error" in answer:
        raise ValueError(answer["error"])
    return answer


def main() -> None:
    """Answer the question on standard input."""
    answering = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what the foreign code prints must not mix with the answer
    _, program, binary = sys.argv
    question = json.loads(sys.stdin.readline())
    try:
        answer = runpy.run_path(program)["answer"](binary, question)
    except (OSError, ValueError) as error:
        answer = {"error": str(error)}
    answering.write(json.dumps(answer))
    answering.close()


if __name__ == "__main__":
    main()
