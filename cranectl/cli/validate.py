"""`cranectl validate`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from cranectl.cli import exit_codes
from cranectl.cli.command import (
    Command,
    drive_option,
    json_option,
    plants_option,
    predict_option,
    scenario_options,
)

if TYPE_CHECKING:
    from cranectl.cases.case import Case, CaseResult, Failure
    from cranectl.cases.workers import Outcome
    from cranectl.compare.agreement import Predict
    from cranectl.scenario import Scenario

SHOWN = 10  # failures shown on the screen


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
    predict: "Predict | None",
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
    from cranectl.cli.output import progress_bar
    from cranectl.controllers.registry import chosen_controllers
    from cranectl.log import check_writable
    from cranectl.plants.plant import DRIVES, Drive
    from cranectl.plants.registry import PLANTS
    from cranectl.scenario import scenario_names
    from cranectl.simulate import checked_drive

    names = chosen_controllers(controllers)
    several: dict[str, tuple[Drive, ...]] = {"both": ("ideal", "velocity"), "all": DRIVES}
    drives = several[drive] if drive in several else (checked_drive(drive),)
    chosen = plants or tuple(PLANTS)
    sources = _sources(scenarios) or scenario_names()
    loaded, unloaded = _loaded(tuple(dict.fromkeys(sources)), rig, overrides, chosen)
    cases = [
        make_case(
            scenario,
            controller=name,
            drive=kind,
            plants=chosen,
            log=default_log(out, scenario, name, kind),
            source=source,
            predict=predict,
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
    return _report(cases, outcome, unloaded, out, json_file)


def _sources(names: Sequence[str]) -> list[str]:
    """`names` with the scenarios of a directory in its place, those of directories below it too.

    Rigs and campaigns there are left out; whatever else is no scenario fails as one. Raises InputError for a
    directory without any.
    """
    from cranectl.support.errors import InputError
    from cranectl.support.files import exists

    sources = []
    for name in names:
        if not exists(Path(name)) or not Path(name).is_dir():
            sources.append(name)
            continue
        files = sorted(str(file) for file in Path(name).rglob("*.toml"))
        files = [file for file in files if not _is_rig_or_campaign(Path(file))]
        if not files:
            raise InputError(
                f"{name}: a directory without scenarios",
                allowed="directories with scenarios, files that end in '.toml'",
                remedy="name another directory, or files",
            )
        sources += files
    return sources


def _is_rig_or_campaign(file: Path) -> bool:
    from cranectl.scenario.rig import RigParameters
    from cranectl.support.documents import read_toml
    from cranectl.support.errors import InputError

    try:
        keys = set(read_toml(file))
    except InputError:  # told when it is loaded
        return False
    return "scenario" in keys or keys <= set(RigParameters.model_fields)


def _loaded(
    names: Sequence[str], rig: Path | None, overrides: Sequence[str], plants: Sequence[str]
) -> tuple[dict[str, "Scenario"], dict[str, "Failure"]]:
    """The scenarios by the names they were asked for, and why others cannot be loaded."""
    from cranectl.cases.case import Failure
    from cranectl.metrics.limits import limits_of
    from cranectl.scenario import load_scenario

    loaded, unloaded = {}, {}
    for name in names:
        try:
            scenario = load_scenario(name, rig=rig, overrides=overrides)
            limits_of(scenario, plants)
            loaded[name] = scenario
        except Exception as error:
            unloaded[name] = Failure.of(error)
    return loaded, unloaded


class Failed(NamedTuple):
    """What could not be run, and why; without controller and drive it is the whole scenario."""

    scenario: str  # as it was asked for
    controller: str | None
    drive: str | None
    failure: "Failure"


def _report(
    cases: "Sequence[Case]",
    outcome: "Outcome",
    unloaded: "Mapping[str, Failure]",
    out: Path,
    json_file: str | None,
) -> int:
    """Say what came of `cases`, and why scenarios could not be loaded; returns the exit code."""
    from cranectl.cases.case import CaseResult, Failure
    from cranectl.cli.output import FAILED, PASSED, console, styled, write_json
    from cranectl.report.run.tables import agreement_table, limit_notes, limits_table, run_notes

    pairs = list(zip(cases, outcome.results, strict=True))
    failed = [Failed(name, None, None, failure) for name, failure in unloaded.items()]
    failed += [
        Failed(c.source, c.controller, c.drive, result) for c, result in pairs if isinstance(result, Failure)
    ]
    finished = [result for _, result in pairs if isinstance(result, CaseResult)]
    lost = [case for case, result in pairs if result is None]
    code = _exit_code(finished, [each.failure for each in failed], lost, interrupted=outcome.interrupted)
    if finished or lost:
        screen = console(json_file)
        agreements = [agreement for each in finished for agreement in each.agreements]
        others = [each.other_failures for each in finished for _ in each.agreements]
        unjudged = sum(agreement.passed is None for agreement in agreements)
        screen.print(agreement_table(agreements, others))
        runs = [run for each in finished for run in each.runs]
        if (limits := limits_table(runs, broken_only=True)) is not None:
            screen.print(limits)
        why = "interrupted before it ran" if outcome.interrupted else "its worker process died"
        for note in (*limit_notes(agreements), *run_notes(finished)):
            screen.print(f"  {note}")
        for case in lost:
            name = f"{case.source}, {case.controller}, {case.drive}"
            screen.print(" ", styled(f"{name}: no result, {why}", "bold red"))
        screen.print(f"{len(runs)} runs, logs in {out}")
        aside = [f"({unjudged} of {len(agreements)} pairs not judged)"] if unjudged else []
        screen.print("validation", PASSED if code == exit_codes.GOOD else FAILED, *aside)
    _tell(failed)
    write_json(json_file, _json(finished, failed, lost, passed=code == exit_codes.GOOD))
    return code


def _exit_code(
    finished: "Sequence[CaseResult]",
    failed: "Sequence[Failure]",
    lost: "Sequence[Case]",
    *,
    interrupted: bool,
) -> int:
    """The code that says most: interrupted, unforeseen or a worker died, bad input, stopped, disagreed, good.

    A run that stops as its scenario expects is good.
    """
    if interrupted:
        return exit_codes.INTERRUPTED
    if lost or not all(failure.bad_input for failure in failed):
        return exit_codes.UNFORESEEN
    if failed:
        return exit_codes.BAD_INPUT
    if any(result.stopped and not result.as_expected for result in finished):
        return exit_codes.RUN_STOPPED
    return exit_codes.GOOD if all(result.passed for result in finished) else exit_codes.LIMIT_EXCEEDED


def _tell(failed: Sequence[Failed]) -> None:
    """Say on standard error why cases could not be run, each reason once for a scenario."""
    from cranectl.cli.output import console

    screen = console("-")
    alike: dict[tuple[str, Failure], list[str]] = {}
    for each in failed:
        name = ", ".join(part for part in (each.scenario, each.controller, each.drive) if part is not None)
        alike.setdefault((each.scenario, each.failure), []).append(name)
    for (scenario, failure), names in list(alike.items())[:SHOWN]:
        name = names[0] if len(names) == 1 else f"{scenario}, {len(names)} cases"
        screen.print(f"{name}: could not be run" if failure.bad_input else f"{name}: unforeseen")
        full_traceback = click.get_current_context().obj
        for line in (*failure.reason.splitlines(), *(failure.trace.splitlines() if full_traceback else ())):
            screen.print(line)
    if len(alike) > SHOWN:
        screen.print(f"and {len(alike) - SHOWN} more")


def _json(
    finished: "Sequence[CaseResult]", failed: Sequence[Failed], lost: "Sequence[Case]", *, passed: bool
) -> dict[str, Any]:
    return {
        "passed": passed,
        "runs": [run.to_json() for result in finished for run in result.runs],
        "agreements": [agreement.to_json() for result in finished for agreement in result.agreements],
        "failed": [
            {
                "scenario": each.scenario,
                "controller": each.controller,
                "drive": each.drive,
                "reason": each.failure.reason,
                "bad_input": each.failure.bad_input,
            }
            for each in failed
        ],
        "lost": [
            {"scenario": case.scenario.name, "controller": case.controller, "drive": case.drive}
            for case in lost
        ],
    }
