"""`cranectl`: entry point, and how errors become messages and exit codes.

Command modules import what they need inside their functions, so that `--help` stays fast.
"""

import os
import sys

import click

from cranectl.cli import exit_codes
from cranectl.cli.advise import advise_command
from cranectl.cli.budget import budget_command
from cranectl.cli.campaign import campaign_command
from cranectl.cli.certify import certify_command
from cranectl.cli.compare import compare_command
from cranectl.cli.design import design_command
from cranectl.cli.export import export_command
from cranectl.cli.info import info_command
from cranectl.cli.ladder import ladder_command
from cranectl.cli.layout import layout_command
from cranectl.cli.list import list_command
from cranectl.cli.live import live_command
from cranectl.cli.recover import recover_command
from cranectl.cli.render import render_command
from cranectl.cli.report import report_command
from cranectl.cli.run import run_command
from cranectl.cli.thesis import thesis_command
from cranectl.cli.validate import validate_command
from cranectl.errors import CranectlError
from cranectl.interrupts import heed_interrupts, interrupt

HELP = """Validate crane controllers against independent physics.

One flatness-based tracking controller, two plants that know nothing of each other: the analytic Lagrange
model and a MuJoCo model of the rig. Every run is an MCAP log that opens in Foxglove.

\b
  cranectl list                              what there is to run
  cranectl run settled-trajectory            run it on both plants and compare
  cranectl live fixed-position               watch it and steer it in Foxglove
  cranectl validate                          run everything, judge, exit 1 if a limit is exceeded

\b
Exit codes: 0 good, 1 a validation limit exceeded, 2 bad input, 3 a run stopped early (its log is readable),
130 interrupted.
"""


cli = click.Group(
    "cranectl",
    help=HELP,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
cli = click.version_option(package_name="cranectl")(cli)
for command in (
    list_command,
    run_command,
    validate_command,
    compare_command,
    info_command,
    design_command,
    certify_command,
    thesis_command,
    report_command,
    ladder_command,
    budget_command,
    layout_command,
    export_command,
    live_command,
    render_command,
    recover_command,
    advise_command,
    campaign_command,
):
    cli.add_command(command)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    # Matrices here are small: threads of the linear algebra library only wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    heed_interrupts(interrupt)
    try:
        code = cli.main(args=arguments, prog_name="cranectl", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        return exit_codes.BAD_INPUT
    except CranectlError as error:
        click.echo(f"cranectl: bad input\n{error}", err=True)
        return exit_codes.BAD_INPUT
    except (KeyboardInterrupt, click.Abort):
        click.echo("cranectl: interrupted", err=True)
        return exit_codes.INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone; nothing to tell, and nothing left to flush at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return exit_codes.GOOD
    return code if isinstance(code, int) else exit_codes.GOOD
