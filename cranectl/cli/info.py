"""`cranectl info`."""

from pathlib import Path

import click

from cranectl.cli.command import Command
from cranectl.cli.options import json_option, predict_option


@click.command("info", cls=Command)
@click.argument("log", metavar="LOG", type=click.Path(path_type=Path))
@predict_option
@json_option
def info_command(log: Path, predict: bool, json_file: str | None) -> None:
    """Say what LOG is: scenario, design, parameters, versions, topics, verdict, integrity.

    Every message and checksum is read; a damaged file is refused with the reason.

    \b
    cranectl info logs/fixed-position/lqr-ideal.mcap
    """
    from cranectl.cli.judgement import limits_of
    from cranectl.cli.output import console, info_lines, topic_table, write_json
    from cranectl.compare import judge
    from cranectl.log import describe_log, read_log
    from cranectl.support.provenance import provenance, provenance_differences

    runs = read_log(log)
    description = describe_log(log)
    pair = list(runs.values())
    both = len(pair) == 2 and all(len(run.time_ns) for run in pair)
    agreement = judge(*pair, limits=limits_of(pair[0], predict=predict)) if both else None
    software = provenance_differences(description.versions, provenance())
    screen = console(json_file)
    for line in info_lines(description, pair, agreement, software):
        screen.print(line)
    screen.print(topic_table(description))
    write_json(
        json_file,
        {
            **description.to_json(),
            "scenario": pair[0].scenario.model_dump(mode="json"),
            "design": pair[0].design.to_json(),
            "runs": [
                {
                    "plant": run.plant,
                    "drive": run.drive,
                    "status": run.status.label,
                    "end_s": run.end_s,
                    "samples": len(run.time_ns),
                }
                for run in pair
            ],
            "agreement": agreement.to_json() if agreement is not None else None,
            "software_differences": software,
        },
    )
