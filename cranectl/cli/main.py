"""`cranectl`: entry point, and how errors become messages and exit codes.

Command modules import what they need inside their functions, so that `--help` stays fast.
"""

import io
import os
import sys
import traceback

import click

from cranectl.cli import exit_codes
from cranectl.cli.advise import advise_command
from cranectl.cli.benchmark import benchmark_command
from cranectl.cli.budget import budget_command
from cranectl.cli.campaign import campaign_command
from cranectl.cli.certify import certify_command
from cranectl.cli.command import Invocation
from cranectl.cli.compare import compare_command
from cranectl.cli.design import design_command
from cranectl.cli.info import info_command
from cranectl.cli.ladder import ladder_command
from cranectl.cli.list import list_command
from cranectl.cli.live import live_command
from cranectl.cli.log import log_command
from cranectl.cli.new import new_command
from cranectl.cli.plan import plan_command
from cranectl.cli.render import render_command
from cranectl.cli.report import report_command
from cranectl.cli.run import run_command
from cranectl.cli.streams import steady_streams
from cranectl.cli.thesis import thesis_command
from cranectl.cli.tune import tune_command
from cranectl.cli.validate import validate_command
from cranectl.support.environment import MachineError, is_of_machine
from cranectl.support.errors import CranectlError, InputError, describe_error, printable
from cranectl.support.interrupts import came_of_interrupt, heed_interrupts, interrupt

TRACEBACK = "--traceback"  # anywhere on the command line

HELP = """Validate crane controllers against independent physics.

Any controller, first of all a flatness-based tracker, and plants that know nothing of each other: two
derivations of our own and models in the engines MuJoCo and Drake. Every run is an MCAP log that opens in
Foxglove.

\b
Exit codes:
""" + "\n".join(f"  {code:3}  {meaning}" for code, meaning in exit_codes.MEANINGS.items())


COMMANDS: dict[str, tuple[click.Command, ...]] = {
    "Run": (new_command, plan_command, run_command, live_command, campaign_command, tune_command),
    "Look": (
        list_command,
        info_command,
        compare_command,
        report_command,
        render_command,
        log_command,
    ),
    "Judge": (validate_command, benchmark_command, certify_command, advise_command),
    "Explain": (design_command, ladder_command, budget_command, thesis_command),
}


class CommandTree(click.Group):
    """All commands, grouped by purpose in `--help`."""

    def format_commands(self, _context: click.Context, formatter: click.HelpFormatter) -> None:
        width = max(map(len, self.commands))
        for purpose, commands in COMMANDS.items():
            with formatter.section(purpose):
                summaries = [each.get_short_help_str(formatter.width) for each in commands]
                names = [f"{each.name:{width}}" for each in commands]
                formatter.write_dl(list(zip(names, summaries, strict=True)))


cli = CommandTree(
    "cranectl",
    [command for commands in COMMANDS.values() for command in commands],
    help=HELP,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
cli = click.version_option(package_name="cranectl")(cli)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    # Matrices here are small: threads of the linear algebra library only wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ["MPLBACKEND"] = "agg"  # pictures go into files, whatever the user's own plots need
    heed_interrupts(interrupt)
    given = sys.argv[1:] if arguments is None else arguments
    with steady_streams():
        return _run([argument for argument in given if argument != TRACEBACK], TRACEBACK in given)


def _run(arguments: list[str], full_traceback: bool) -> int:
    try:
        if any("\0" in argument for argument in arguments):  # no shell can pass one
            raise InputError("an argument with a null character", remedy="leave it out")
        given = Invocation(tuple(arguments), full_traceback)
        code = cli.main(args=arguments, prog_name="cranectl", standalone_mode=False, obj=given)
    except click.ClickException as error:
        shown = io.StringIO()
        error.show(file=shown)
        print("\n".join(map(printable, shown.getvalue().rstrip().split("\n"))), file=sys.stderr)
        return exit_codes.BAD_INPUT
    except CranectlError as error:
        print(f"cranectl: bad input\n{error}", file=sys.stderr)
        return exit_codes.BAD_INPUT
    except (KeyboardInterrupt, Exception) as error:
        if came_of_interrupt(error) or isinstance(error, click.Abort):
            print("cranectl: interrupted", file=sys.stderr)
            return exit_codes.INTERRUPTED
        if is_of_machine(error):
            print(f"cranectl: bad input\n{MachineError.of(describe_error(error))}", file=sys.stderr)
            return exit_codes.BAD_INPUT
        if full_traceback:
            traceback.print_exc()
        what = printable(describe_error(error))
        print(f"cranectl: unforeseen {what}; please report it with what {TRACEBACK} adds", file=sys.stderr)
        return exit_codes.UNFORESEEN
    return code if isinstance(code, int) else exit_codes.GOOD
