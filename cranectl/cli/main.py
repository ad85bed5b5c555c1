"""`cranectl`: entry point, and how errors become messages and exit codes.

Each command is loaded when it is called. Its module imports what computes inside its functions, so that
`--help` stays fast.
"""

import errno
import importlib
import io
import os
import sys
import traceback
from collections import UserDict
from typing import Any

import click

from cranectl.cli.command import Invocation
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.streams import steady_streams
from cranectl.support import CranectlError, InputError, Interruption, MachineError, printable

WRONG_NAMES = (
    errno.ENAMETOOLONG, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM, errno.ELOOP, errno.EINVAL,
    errno.EEXIST, errno.ENOENT,
)  # fmt: skip
TRACEBACK = "--traceback"  # anywhere on the command line

HELP = """Validate crane controllers against independent physics.

A controller, for example a flatness-based tracker, runs on several models of the same crane that share
no equation: two derivations of our own, MuJoCo and Drake. Every run is an MCAP log that opens in
Foxglove.

\b
Exit codes:
""" + "\n".join(f"  {code:3}  {code.meaning}" for code in ExitCode)


# Name of each command, and the first line of its help.
COMMANDS = {
    "Run": {
        "new": "Write a small working example of a file, with its test.",
        "plan": "Plan the motions of SCENARIO and show them, without a run.",
        "run": "Run SCENARIO, a name or a TOML file, and compare the plants.",
        "live": "Run SCENARIO in real time, to be watched and steered.",
        "campaign": "Run one scenario many times under stated uncertainty.",
        "tune": "Find the numbers of CONTROLLER, by name or file.",
    },
    "Look": {
        "list": "List scenarios, rigs, controllers, plants and drives.",
        "info": "Show what a log, a rig, a scenario or a crane's model file is.",
        "compare": "Compare the plants of one LOG, two LOGs, or a crane with models.",
        "report": "Write runs, or the thesis, as one page of figures and tables.",
        "render": "Draw LOG as a video, or one moment of it as a picture.",
        "log": "Import, export, recover or overlay logs, lay out a viewer.",
    },
    "Judge": {
        "validate": "Run scenarios on all plants and judge their agreement.",
        "benchmark": "Measure controllers on the same cranes, by rules that favour none.",
        "certify": "Prove at which operating points CONTROLLER is stable.",
    },
    "Explain": {
        "design": "Design one or several controllers and show what they achieve.",
        "ladder": "Measure what each effect of the real rig costs, one by one.",
        "identify": "Fit the numbers of a crane to at least three measured runs.",
        "thesis": "Run chapter 5 of the thesis again and compare its numbers.",
    },
}
# Commands that stand with what they compute.
ELSEWHERE = {
    "benchmark": "tools.benchmark.commands.benchmark",
    "tune": "tools.benchmark.commands.tune",
    "certify": "tools.robustness.commands.certify",
    "ladder": "tools.robustness.commands.ladder",
    "identify": "tools.measured.commands.identify",
    "live": "tools.live.command",
    "render": "tools.render.command",
    "thesis": "tools.thesis.command",
    "campaign": "campaign.commands",
}
NAMES = [name for summaries in COMMANDS.values() for name in summaries]


class Commands(UserDict[str, Any]):
    """All commands by name; each is imported when it is first looked up."""

    def __getitem__(self, name: str) -> click.Command:
        if self.data[name] is None:
            module = importlib.import_module(f"cranectl.{ELSEWHERE.get(name, f'cli.{name}')}")
            self.data[name] = getattr(module, f"{name}_command")
        command: click.Command = self.data[name]
        return command


class CommandTree(click.Group):
    """All commands, grouped by purpose in `--help`."""

    def format_commands(self, _context: click.Context, formatter: click.HelpFormatter) -> None:
        width = max(map(len, NAMES))
        for purpose, summaries in COMMANDS.items():
            with formatter.section(purpose):
                formatter.write_dl([(f"{name:{width}}", summary) for name, summary in summaries.items()])


cli = CommandTree(
    "cranectl",
    Commands(dict.fromkeys(NAMES)),
    help=HELP,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
cli = click.version_option(package_name="cranectl")(cli)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    # Matrices here are small: threads of the linear algebra library only wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ["MPLBACKEND"] = "agg"  # pictures go into files, whatever the user's own plots need
    Interruption.heed()
    words = sys.argv[1:] if arguments is None else arguments
    arguments = [argument for argument in words if argument != TRACEBACK]
    with steady_streams():
        return _run(arguments, TRACEBACK in words)


def _run(arguments: list[str], full_traceback: bool) -> int:
    try:
        if any("\0" in argument for argument in arguments):  # no shell can pass one
            raise InputError("an argument with a null character", remedy="leave it out")
        invocation = Invocation(tuple(arguments), full_traceback)
        code = cli.main(args=arguments, prog_name="cranectl", standalone_mode=False, obj=invocation)
    except click.ClickException as error:
        shown = io.StringIO()
        error.show(file=shown)
        print("\n".join(map(printable, shown.getvalue().rstrip().split("\n"))), file=sys.stderr)
        return ExitCode.BAD_INPUT
    except CranectlError as error:
        print(f"cranectl: bad input\n{error}", file=sys.stderr)
        return ExitCode.BAD_INPUT
    except (KeyboardInterrupt, Exception) as error:
        if Interruption.is_cause_of(error) or isinstance(error, click.Abort):
            print("cranectl: interrupted", file=sys.stderr)
            return ExitCode.INTERRUPTED
        if (named := _wrong_name(error, arguments)) is not None:
            print(f"cranectl: bad input\n{named}", file=sys.stderr)
            return ExitCode.BAD_INPUT
        if MachineError.is_cause_of(error):
            print(f"cranectl: bad input\n{MachineError.of(InputError.describe(error))}", file=sys.stderr)
            return ExitCode.BAD_INPUT
        if full_traceback:
            traceback.print_exc()
        what = printable(InputError.describe(error))
        print(f"cranectl: unforeseen {what}; please report it with what {TRACEBACK} adds", file=sys.stderr)
        return ExitCode.UNFORESEEN
    return code if isinstance(code, int) else ExitCode.GOOD


def _wrong_name(error: BaseException, arguments: list[str]) -> InputError | None:
    """Return the error for a file that an argument names and that the system refuses, or None.

    Commands check what they read and write. Here is what no check can foresee, such as the longest name that
    a file system takes.
    """
    is_loop = isinstance(error, RuntimeError) and str(error).startswith("Symlink loop from")
    found = str(error) if is_loop else ""
    if isinstance(error, OSError) and error.errno in WRONG_NAMES and error.filename is not None:
        path = os.fsdecode(error.filename)
        given = [word.partition("=")[2] if word.startswith("--") else word for word in arguments]
        if any(name and name in path for name in given):
            found = f"{path}: {error.strerror}"
    if not found:
        return None
    return InputError(
        found,
        allowed="a name that the file system takes, in a place that may be read or written",
        remedy="choose another name or place",
    )
