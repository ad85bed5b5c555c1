"""`cranectl validate`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli.command import Command
from cranectl.cli.options import drive_option, json_option, plants_option, predict_option, scenario_options

if TYPE_CHECKING:
    from cranectl.cases.case import Case, Failure
    from cranectl.scenario import Scenario


@click.command("validate", cls=Command)
@click.argument("scenarios", metavar="[SCENARIO]...", nargs=-1)
@click.option(
    "--controller",
    "controllers",
    metavar="NAME",
    multiple=True,
    help="Default: the flat family; all: every controller; repeatable.",
)
@plants_option("Default: all.")
@drive_option(default="both")
@scenario_options
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("logs"),
    show_default=True,
    help="Directory for the logs.",
)
@click.option(
    "--jobs", metavar="N", type=click.IntRange(min=1), help="Worker processes. Default: one for each core."
)
@predict_option
@json_option
def validate_command(
    scenarios: tuple[str, ...],
    controllers: tuple[str, ...],
    plants: tuple[str, ...],
    drive: str,
    rig: Path | None,
    overrides: tuple[str, ...],
    out: Path,
    jobs: int | None,
    predict: bool,
    json_file: str | None,
) -> int:
    """Run scenarios on all plants and judge their agreement.

    With all controllers, ideal and velocity drives. The limits and their reasons are in
    validation/tolerances.toml. Those of velocity drives hold for the shipped scenarios and their rig: others
    are shown and not judged, or with --predict judged by their own. A scenario that cannot be run is a failed
    case with its reason; the others run.

    \b
    cranectl validate
    cranectl validate fixed-position --controller lqr --drive ideal --json -
    cranectl validate --jobs 1 --set rig.load_mass=2.5

    Exit codes, the first that holds: 130 interrupted; 70 a worker died, or an error that nobody foresaw;
    2 a scenario could not be run; 3 a run stopped against expectation; 1 a limit exceeded; 0 good.
    """
    from cranectl.cases.case import check_logs_differ, default_log, make_case
    from cranectl.cases.workers import available_cores, run_cases
    from cranectl.cli.judgement import predictor
    from cranectl.cli.output import progress_bar
    from cranectl.cli.validate_output import report_validation
    from cranectl.controllers.registry import chosen_controllers
    from cranectl.log import check_writable
    from cranectl.plants.plant import DRIVES, Drive
    from cranectl.plants.registry import PLANTS
    from cranectl.scenario import scenario_names
    from cranectl.simulate import checked_drive

    names = chosen_controllers(controllers)
    several: dict[str, tuple[Drive, ...]] = {"both": ("ideal", "velocity"), "all": DRIVES}
    drives = several[drive] if drive in several else (checked_drive(drive),)
    loaded, unloaded = _loaded(tuple(dict.fromkeys(scenarios)) or scenario_names(), rig, overrides)
    cases = [
        make_case(
            scenario,
            controller=name,
            drive=kind,
            plants=plants or PLANTS,
            log=default_log(out, scenario, name, kind),
            source=source,
            predict=predictor(wanted=predict),
        )
        for source, scenario in loaded.items()
        for name in names
        for kind in drives
    ]
    check_logs_differ(cases)
    if cases:
        check_writable(out / "any.mcap")  # once, not by every case
    with progress_bar(sum(case.simulated_seconds for case in cases)) as (advance, describe):

        def done(case: "Case") -> None:
            describe(f"{case.scenario.name}, {case.controller}")
            advance(case.simulated_seconds)

        outcome = run_cases(cases, jobs=jobs or available_cores(), done=done)
    return report_validation(cases, outcome, unloaded, out, json_file)


def _loaded(
    names: Sequence[str], rig: Path | None, overrides: Sequence[str]
) -> tuple[dict[str, "Scenario"], dict[str, "Failure"]]:
    """The scenarios by the names they were asked for, and why others cannot be loaded."""
    from cranectl.cases.case import Failure
    from cranectl.scenario import load_scenario

    loaded, unloaded = {}, {}
    for name in names:
        try:
            loaded[name] = load_scenario(name, rig=rig, overrides=overrides)
        except Exception as error:
            unloaded[name] = Failure.of(error)
    return loaded, unloaded
