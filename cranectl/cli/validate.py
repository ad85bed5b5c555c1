"""`cranectl validate`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from cranectl import cases as case_runs
from cranectl import log as log_files
from cranectl import metrics, simulate
from cranectl import report as pages
from cranectl import scenario as scenario_files
from cranectl.cli.command import Command
from cranectl.cli.completion import Completion
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.counts import Count
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.names import Names
from cranectl.cli.output import Screen
from cranectl.cli.scenario_request import ScenarioRequest
from cranectl.cli.validate_results import print_results
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.plants import DRIVES, PLANTS, Drive
from cranectl.support import TOML, File, FileKind, InputError
from cranectl.tools import render
from cranectl.tools.measured.commands.files import MeasuredRuns
from cranectl.tools.measured.commands.verdict import is_measured, judge_runs

if TYPE_CHECKING:
    from cranectl.report import Page
    from cranectl.scenario import Scenario


@click.command("validate", cls=Command)
@click.argument("scenarios", metavar="[SCENARIO]...", nargs=-1, shell_complete=Completion.scenarios)
@ControllerName.repeated_option(
    "Default: the six of the flat family; all: every one; law.py:NAME; repeatable."
)
@Names.run_plants_option
@ScenarioRequest.drive_option(default="both")
@ScenarioRequest.options
@Command.directory_option("--out", "Directory for the logs.", default="logs", show_default=True)
@Count.option("--jobs", "Worker processes. Default: one for each core.", highest=Count.MAX_WORKERS)
@ScenarioRequest.every_option
@ControllerName.timeout_option
@ControllerName.trust_option("SCENARIO")
@click.option(
    "--keep",
    type=click.Choice(["all", "failed", "none"]),
    default="all",
    show_default=True,
    help="Which logs stay.",
)
@click.option(
    "--pairwise", is_flag=True, help="Compare every plant with every other, and each with finer steps."
)
@click.option(
    "--details", is_flag=True, help="Show every controller and plant, not only the largest differences."
)
@MeasuredRuns.map_option("For measured files: map of their columns.")
@MeasuredRuns.sheets_option("With --map: a run for each sheet that fits, e.g. 'Run*'.")
@click.option("--tolerance", metavar="SIZE", help="For measured runs: the difference you accept, e.g. 5mm.")
@Command.output_option("--junit", FileKind.XML, "Write JUnit XML, a test case for each case.")
@Command.output_option("--report", FileKind.HTML, "Write one HTML page: verdict, limits, worst moments.")
@Command.json_option
def validate_command(
    scenarios: tuple[str, ...],
    controllers: tuple[str, ...],
    plants: tuple[str, ...],
    drive: str,
    request: ScenarioRequest,
    out: Path,
    jobs: int | None,
    timeout: float,
    trust: bool,
    keep: Literal["all", "failed", "none"],
    pairwise: bool,
    details: bool,
    map_file: Path | None,
    sheets: str | None,
    tolerance: str | None,
    junit: Path | None,
    report: Path | None,
    screen: Screen,
) -> int:
    """Run scenarios on all plants and judge their agreement.

    Runs the six controllers of the flat family, or those that --controller names, with ideal and
    velocity drives; a scenario with a controller of another family runs with that one. The limits of
    agreement and their reasons are in validation/tolerances.toml; they hold for every scenario and rig.
    A scenario's own [limits] are judged too. A scenario that cannot be run is a failed case with its
    reason; the others run. The screen shows the largest differences of each scenario, and what failed.

    SCENARIO is a name, a file, or a directory with scenarios, also in directories below it.

    Measured runs in place of scenarios are judged by the crane that `cranectl identify` wrote, which must
    not have used them. They are logs of `cranectl log import`, or with --map the files that it reads, each a
    run. Answers: covered; not covered, but within your tolerance; not covered; or not decided, with the
    reason. Exit code 1 for the last two.

    \b
    cranectl validate
    cranectl validate fixed-position --controller lqr --drive ideal --json -
    cranectl validate scenarios/ --keep failed --every 20 --junit junit.xml --report validation.html
    cranectl validate --jobs 1 --set rig.load_mass=2.5
    cranectl validate near-slack --plants all --drive all --pairwise
    cranectl validate thursday.csv --map week.toml --rig identified.toml --tolerance 5mm
    cranectl validate thursday.mcap friday.mcap --rig identified.toml --tolerance 5mm

    Exit codes, the first that holds: 130 interrupted; 70 a worker died, or an error that nobody foresaw;
    2 a scenario could not be run; 3 a run stopped against expectation; 1 a limit exceeded; 0 good.
    """
    own_options = (map_file, sheets, tolerance)  # of measured runs
    if any(map(is_measured, scenarios)) or any(option is not None for option in own_options):
        return judge_runs(
            scenarios, request.rig, map_file=map_file, sheets=sheets, tolerance=tolerance, junit=junit,
            report=report, screen=screen,
        )  # fmt: skip
    names = ALL_CONTROLLERS.chosen(controllers)
    sources = Counter(_sources(scenarios))
    screen.print_each(
        f"{name} is given more than once, and judged once" for name, n in sources.items() if n > 1
    )
    loaded, unloaded = _loaded(request, tuple(sources), plants)
    controllers_of: dict[str, Sequence[str]] = dict.fromkeys(loaded, names)
    if not controllers:
        controllers_of |= {source: _usual_or_own(scenario, names) for source, scenario in loaded.items()}
        _open_own(controllers_of, loaded, unloaded, trust)
    cases = _cases(
        loaded, controllers_of, drive, plants, out=out, keep=keep, pairwise=pairwise, timeout=timeout
    )
    screen.print_each(dict.fromkeys(line for case in cases for line in case.left_out))
    validation = _run(cases, unloaded, plants, out, jobs)
    code = _exit_code(validation)
    pairs = case_runs.Pairwise.of(validation) if pairwise else None
    screen.print_each(pages.DifferenceTables.pairs(pairs) if pairs and pairs.pairs else ())
    print_results(validation, code, out, screen, details=details)
    idle = IdleSettings.timeout_lines([case.controller for case in cases] or names, timeout)
    for source, scenario in loaded.items():
        uses = [(p, case.drive, case.controller) for case in cases for p in case.plants]
        unread = ("log.*",) * (keep == "none")
        idle += IdleSettings.lines(scenario, request._replace(source=source), uses, unread=unread)
    IdleSettings.print(screen, idle)
    data = validation.to_json(passed=code == ExitCode.GOOD)
    screen.write_json(data if pairs is None else {**data, "pairwise": pairs.to_json()})
    options = [
        *(("--rig", str(request.rig)) if request.rig else ()),
        *(part for override in request.overrides for part in ("--set", override)),
        *(("--timeout", f"{timeout:g}") if timeout != simulate.Loop.TIMEOUT else ()),
    ]
    if junit is not None:
        screen.save_junit(validation.junit_cases(options), junit)
    if report is not None:
        screen.save_page(_page(validation, options, pairs, screen), report)
    return code


def _cases(
    loaded: Mapping[str, "Scenario"],
    controllers_of: Mapping[str, Sequence[str]],
    drive: str,
    plants: tuple[str, ...],
    *,
    out: Path,
    keep: Literal["all", "failed", "none"],
    pairwise: bool,
    timeout: float,
) -> list["case_runs.Case"]:
    """Return a case for each scenario, controller and drive, with logs in `out` that all differ."""
    several: dict[str, tuple[Drive, ...]] = {"both": ("ideal", "velocity"), "all": tuple(DRIVES)}
    drives = several.get(drive) or (DRIVES.checked(drive),)
    cases = [
        case_runs.Case.of(
            scenario,
            controller=name,
            drive=kind,
            plants=plants,
            log=case_runs.Case.log_in(out, scenario, name, kind),
            source=source,
            keep=keep,
            pairwise=pairwise,
            timeout=timeout,
        )
        for source, scenario in loaded.items()
        for name in controllers_of[source]
        for kind in _common_drives(scenario.rig, plants, drives)
    ]
    case_runs.Case.check_logs_differ(cases)
    return cases


def _usual_or_own(scenario: "Scenario", usual: Sequence[str]) -> Sequence[str]:
    own = scenario.controller.name
    return usual if own in usual else (own,)


def _open_own(
    controllers_of: dict[str, Sequence[str]],
    loaded: dict[str, "Scenario"],
    unloaded: dict[str, "case_runs.Failure"],
    trust: bool,
) -> None:
    """Open the files that scenarios name as their controllers, if the user trusts them.

    A scenario whose controller cannot be opened is moved to those that are not loaded.
    """
    for source, (name, *_) in [*controllers_of.items()]:
        try:
            if trust and ALL_CONTROLLERS.is_reference(name):
                controllers_of[source] = (ControllerName.open_own(loaded[source], source),)
        except Exception as error:
            unloaded[source] = case_runs.Failure.of(error)
            del loaded[source]


def _run(
    cases: Sequence["case_runs.Case"],
    unloaded: Mapping[str, "case_runs.Failure"],
    plants: tuple[str, ...],
    out: Path,
    jobs: int | None,
) -> "case_runs.Validation":
    """Run all cases under a bar of progress."""
    used = {plant for case in cases for plant in case.plants}
    chosen = PLANTS.in_order(used) or plants or PLANTS.by_default
    if cases:
        FileKind.MCAP.check_place(out / "any.mcap", option="--out")  # once, not by every case
    with Screen.progress_bar(sum(case.simulated_seconds for case in cases)) as advance:

        def done(case: "case_runs.Case") -> None:
            advance(case.simulated_seconds, f"{case.scenario.name}, {case.controller}")

        return case_runs.Validation.run(
            cases, unloaded, chosen, jobs=jobs or Count.available_cores(), done=done
        )


def _page(
    validation: "case_runs.Validation",
    options: Sequence[str],
    pairs: "case_runs.Pairwise | None",
    screen: Screen,
) -> "Page":
    """Return the page, with a picture of the worst moment of each scenario whose log is kept."""
    moments = {}
    try:
        for source, log in pages.ValidationPage.worst_logs(validation).items():
            moments[source] = render.draw_worst_moment(log_files.read_log(log))
    except InputError as error:
        screen.print(f"report: no picture of the crane: {error.found}")
    return pages.ValidationPage.of(validation, options, Command.given(), pairs, moments)


def _sources(names: Sequence[str]) -> list[str]:
    """Replace each directory in `names` by the scenarios in and below it; leave out rigs and campaigns.

    Without names, these are all shipped scenarios.
    """
    if not names:
        return scenario_files.scenario_names()
    sources = []
    for name in names:
        if not File(Path(name)).exists() or not Path(name).is_dir():
            sources.append(name)
            continue
        files_below = sorted(Path(name).rglob("*.toml"), key=str)
        files = [str(file) for file in files_below if not _is_rig_or_campaign(file)]
        if not files:
            raise InputError(
                f"{name}: a directory without scenarios",
                allowed="directories with scenarios, files that end in '.toml'",
                remedy="name another directory, or files",
            )
        sources += files
    return sources


def _is_rig_or_campaign(file: Path) -> bool:
    try:
        keys = set(TOML.read(file))
    except InputError:  # told when it is loaded
        return False
    return "scenario" in keys or keys <= {*scenario_files.RigParameters.model_fields, "extends"}


def _common_drives(
    rig: "scenario_files.RigParameters", names: Sequence[str], drives: Sequence[Drive]
) -> list[Drive]:
    """Return those of `drives` that all plants to run have, or else the last one, which is then refused."""
    entries = [PLANTS.find(name, rig) for name in PLANTS.to_run(names, rig)]
    return [drive for drive in drives if all(drive in entry.drives for entry in entries)] or [*drives[-1:]]


def _loaded(
    request: ScenarioRequest, names: Sequence[str], plants: Sequence[str]
) -> tuple[dict[str, "Scenario"], dict[str, "case_runs.Failure"]]:
    """Return scenarios by name, and why others cannot be loaded."""
    loaded, unloaded = {}, {}
    for name in names:
        try:
            scenario = request._replace(source=name).load()
            metrics.Limits.by_plant(scenario, PLANTS.to_run(plants, scenario.rig))
            loaded[name] = scenario
        except Exception as error:
            unloaded[name] = case_runs.Failure.of(error)
    return loaded, unloaded


def _exit_code(validation: "case_runs.Validation") -> int:
    """Return the most serious code; a run that stops as its scenario expects is good."""
    if validation.outcome.interrupted:
        return ExitCode.INTERRUPTED
    failures = [failure for _, _, failure in validation.failures]
    if validation.without_result or not all(failure.bad_input for failure in failures):
        return ExitCode.UNFORESEEN
    if failures:
        return ExitCode.BAD_INPUT
    if any(result.stopped and not result.as_expected for result in validation.finished):
        return ExitCode.RUN_STOPPED
    good = all(result.passed for result in validation.finished)
    return ExitCode.GOOD if good else ExitCode.LIMIT_EXCEEDED
