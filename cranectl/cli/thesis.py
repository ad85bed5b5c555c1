"""`cranectl thesis`."""

import click

from cranectl.cli import exit_codes
from cranectl.cli.options import json_option


@click.command("thesis")
@json_option
def thesis_command(json_file: str | None) -> int:
    """Run chapter 5 of the thesis again and print its numbers beside ours.

    Every run of the chapter, on the analytic plant, on MuJoCo with ideal and with velocity drives. Exit code
    1 if a number is outside its tolerance; printed values, tolerances and their reasons are in
    validation/thesis/.

    \b
    cranectl thesis
    cranectl thesis --json thesis.json
    """
    from cranectl.cli.output import FAILED, PASSED, console, progress_bar, write_json
    from cranectl.cli.thesis_output import thesis_lines, thesis_tables
    from cranectl.thesis import reproduce, total_simulated_seconds

    with progress_bar(total_simulated_seconds()) as (advance, describe):

        def progress(name: str, seconds: float) -> None:
            describe(name)
            advance(seconds)

        found = reproduce(progress)
    screen = console(json_file)
    for table in thesis_tables(found):
        screen.print(table)
    for line in thesis_lines(found):
        screen.print(line, soft_wrap=True)
    verdict = f"{PASSED}: every printed number is within its tolerance, ? marks tolerances without a reason"
    screen.print(verdict if found.passed else f"{FAILED}: see the numbers in red", soft_wrap=True)
    write_json(json_file, found.to_json())
    return exit_codes.GOOD if found.passed else exit_codes.LIMIT_EXCEEDED
