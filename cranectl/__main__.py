"""Start the command line: `python -m cranectl`, or the command `cranectl`."""

import sys

from cranectl.cli.exit_codes import ExitCode
from cranectl.support import Interruption


def main() -> int:
    """Run the command line; handle interrupts from the start, even while modules are loaded."""
    try:
        Interruption.heed()
        from cranectl.cli.main import main

        return main()
    except BaseException as error:
        if not Interruption.is_cause_of(error):
            raise
        sys.stderr.write("cranectl: interrupted\n")
        return ExitCode.INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
