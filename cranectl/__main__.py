"""Start the command line: `python -m cranectl`, or the command `cranectl`."""

import sys

from cranectl.cli import exit_codes
from cranectl.support import heed_interrupts, interrupt, is_caused_by_interrupt


def main() -> int:
    """Run the command line; handle interrupts from the start, even while modules are loaded."""
    try:
        heed_interrupts(interrupt)
        from cranectl.cli.main import main

        return main()
    except BaseException as error:
        if not is_caused_by_interrupt(error):
            raise
        sys.stderr.write("cranectl: interrupted\n")
        return exit_codes.INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
