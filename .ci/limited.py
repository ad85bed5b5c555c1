"""Run a command, end it after a time, and say what is going on, also into a pipe.

    python3 .ci/limited.py [--say TEXT] TARGET SECONDS COMMAND...

A command that prints nothing for long gets --say: the text is printed at once and every ten seconds. Other
commands are printed as they are. A limit only ends what hangs. It says so, and what to do. The environment
variable LIMIT replaces every limit; 0 stands for none.
"""

import argparse
import os
import shlex
import signal
import subprocess
import sys
import time

SAY_EVERY = 10.0  # [s]
GRACE = 30.0  # [s] between the request to end and the kill
LIMIT_EXIT_CODE = 124  # as of timeout(1)


def main() -> int:
    """Return the exit code of the command, or 124 at the limit."""
    arguments = parsed_arguments()
    limit = float(os.environ.get("LIMIT") or arguments.seconds) or float("inf")
    start = time.monotonic()
    process = subprocess.Popen(arguments.command, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the command gets it too, and decides
    signal.signal(signal.SIGTERM, lambda *_: process.terminate())
    said = 0.0
    say(f"make {arguments.target}: {arguments.say or shlex.join(arguments.command)}")
    while True:
        try:
            code = process.wait(timeout=min(1.0, limit))
            return 128 - code if code < 0 else code
        except subprocess.TimeoutExpired:
            elapsed = time.monotonic() - start
        if elapsed > limit:
            break
        if arguments.say and elapsed - said >= SAY_EVERY:
            said = elapsed
            say(f"make {arguments.target}: {arguments.say}, {elapsed:.0f} s")
    process.terminate()
    try:
        process.wait(timeout=GRACE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    say(
        f"make {arguments.target}: ended after {limit:g} s, its limit, which is there to end what hangs.\n"
        f"Run 'make {arguments.target}' again: it keeps what is installed, compiled and planned by now,\n"
        "and begins its cases and tests anew.\n"
        f"On a slow machine run 'make {arguments.target} LIMIT={4 * limit:g}', or LIMIT=0 for no limit."
    )
    return LIMIT_EXIT_CODE


def parsed_arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--say", metavar="TEXT")
    parser.add_argument("target")
    parser.add_argument("seconds")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    return parser.parse_args()


def say(text: str) -> None:
    """Print to standard error, past any buffer."""
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
