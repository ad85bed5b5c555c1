"""`cranectl compare`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl import cases, compare, report, support
from cranectl import log as log_files
from cranectl.cli.command import Command
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.names import Names
from cranectl.cli.output import Screen
from cranectl.cli.refused_options import refuse_options
from cranectl.support import File, FileKind, InputError
from cranectl.tools.measured.commands.verdict import compare_measured

if TYPE_CHECKING:
    from cranectl.simulate import Run
    from cranectl.tools.measured import Replay


@click.command("compare", cls=Command)
@click.argument("logs", metavar="LOG [LOG]", nargs=-1, required=True, type=Command.PATH)
@click.option(
    "--tolerances",
    metavar="NAME",
    help="exact, rounding or a TOML file: judge the first LOG, NEW, by the second, GOLDEN; exit code 1 if a "
    "limit is exceeded.",
)
@Command.output_option("--merge", FileKind.MCAP, "Write two LOGs of different plants as one log of both.")
@click.option(
    "--despite-differences",
    is_flag=True,
    help="With --merge: of different scenarios or versions too; the log then describes the first plant's "
    "scenario and the installed versions.",
)
@Names.plants_option("With a measured LOG: predict it on these. Default: mujoco.", check="check_installed")
@click.option(
    "--replay",
    type=click.Choice(["commands", "lines", "motion"]),
    help="With a measured LOG: repeat its commands, held from row to row, or along lines; or the motion of "
    "bridge, trolley and rope. Default: commands, if it has them.",
)
@Command.output_option(
    "--out", FileKind.MCAP, "With a measured LOG: write it with its predictions as an overlay."
)
@Command.json_option
def compare_command(
    logs: tuple[Path, ...],
    tolerances: str | None,
    merge: Path | None,
    despite_differences: bool,
    plants: tuple[str, ...],
    replay: "Replay | None",
    out: Path | None,
    screen: Screen,
) -> int:
    """Compare the plants of one LOG, two LOGs, or a crane with models.

    The plants of one LOG are judged as by the run that wrote it. Exit code 1 if they do not agree, break
    a limit of their scenario, or did not end as it expects. Runs of an overlay are compared with the
    first one. The difference is second minus first. With --tolerances it is NEW minus GOLDEN, and every
    plant that both have is judged; two directories are compared log by log.
    docs/explanation/validation.md describes files of tolerances. Logs made by other sources or versions
    are compared too, and what differs is named.

    A measured LOG (`cranectl log import`) is predicted by plants, and shown is measured minus predicted.

    \b
    cranectl compare logs/fixed-position/lqr-ideal.mcap
    cranectl compare logs/fixed-position/lqr-ideal.mcap logs/fixed-position/lqr-velocity.mcap
    cranectl compare logs/fixed-position/lqr-ideal.mcap golden.mcap --tolerances exact
    cranectl compare logs golden-logs --tolerances rounding --json verdicts.json
    cranectl compare analytic.mcap mujoco.mcap --merge both.mcap
    cranectl compare measured.mcap --plants mujoco,elastic --replay motion --out predicted.mcap
    """
    _check_request(logs, tolerances, merge, despite_differences)
    alone = log_files.Log.read(logs[0]) if len(logs) == 1 else log_files.Log({})
    if (measured := alone.layers.get("measured")) is not None:
        return compare_measured(logs[0], measured, plants, replay=replay, out=out, screen=screen)
    refuse_options(
        {"--plants": plants, "--replay": replay, "--out": out},
        f"with {logs[0]}, which is not the log of a measured crane",
        allowed="logs that `cranectl log import` made, one at a time",
    )
    if tolerances is not None:
        judge = _judge_directories if File(logs[0]).exists() and logs[0].is_dir() else _judge
        return judge(logs[0], logs[1], tolerances, screen)
    if merge is not None:
        return _merge(logs[0], logs[1], merge, despite_differences, screen)
    if len(logs) == 2:
        return _compare_logs(logs[0], logs[1], screen)
    runs = alone.runs
    return _compare_labelled(runs, screen) if alone.is_overlay else _compare_plants(logs[0], runs, screen)


def _check_request(
    logs: tuple[Path, ...], tolerances: str | None, merge: Path | None, despite_differences: bool
) -> None:
    """Raise InputError for a number of logs, options or directories that do not fit together."""
    one, judged, merged = len(logs) == 1, tolerances is not None, merge is not None
    for wrong, found, allowed, remedy in (
        (len(logs) > 2, f"{len(logs)} logs", "one log or two", "compare them two by two"),
        (judged and merged, "--tolerances and --merge", "one of the two", "leave one out"),
        (judged and one, "--tolerances and one log", "two logs, NEW and GOLDEN", "name a second log"),
        (merged and one, "--merge and one log", "two logs, one of each plant", "name a second log"),
        (despite_differences and not merged, "--despite-differences without --merge", "", "add --merge FILE"),
    ):
        if wrong:
            raise InputError(found, allowed=allowed, remedy=remedy)
    directories = [log for log in logs if File(log).exists() and log.is_dir()]
    if directories and (tolerances is None or len(directories) < len(logs)):
        raise InputError(
            f"{directories[0]} is a directory",
            allowed="two directories with --tolerances, or logs",
            remedy="name two directories of logs, NEW and GOLDEN, and --tolerances",
        )


def _compare_logs(first: Path, second: Path, screen: Screen) -> int:
    """Compare the runs of each plant that two logs share, or the only runs that they hold."""
    logs = cases.LogPair(first, second)
    return _print_pairs(logs.pairs, (first, second), logs.software_differences, screen)


def _merge(first: Path, second: Path, out: Path, despite_differences: bool, screen: Screen) -> int:
    """Write two logs of one plant each as one log, and compare the runs."""
    pair = _merged(first, second, out, despite_differences)
    return _print_pairs([pair], (first, second), [], screen, written=out)


def _print_pairs(
    pairs: list[tuple["Run", "Run"]],
    logs: tuple[Path, Path],
    software: list[str],
    screen: Screen,
    written: Path | None = None,
) -> int:
    """Print the differences of runs of two logs, and of their settings and software."""
    differing = compare.Differences.of(*pairs[0])
    comparisons = [compare.compare_runs(a, b) for a, b in pairs]
    screen.print_each(f"the runs differ in {difference}" for difference in differing.first)
    a, b = Names.of_files(logs)
    for (run, _), comparison in zip(pairs, comparisons, strict=True):
        alike = comparison.a == comparison.b
        _print(screen, comparison, f"{run.plant}: {b} minus {a}" if alike else "")
    screen.print_each(f"made by other software: {difference}" for difference in software)
    if written is not None:
        screen.print(f"log: {written}")
    compared = [comparison.to_json() for comparison in comparisons]
    screen.write_json(
        {"comparisons": compared, "differing_fields": differing, "software_differences": software}
    )
    return ExitCode.GOOD


def _print(screen: Screen, comparison: "compare.Comparison", title: str = "") -> None:
    """Print every signal, then the largest differences, under `title` or the names of the runs."""
    screen.print(
        report.DifferenceTables.of_signals(title or f"{comparison.b} minus {comparison.a}", comparison)
    )
    screen.print(
        f"loads differ by at most {comparison.max_load_error_m:.3e} m, "
        f"at {comparison.max_load_error_at_s:g} s; "
        f"angles {comparison.max_angle_error_rad:.3e} rad; {comparison.samples} common samples"
    )
    if not comparison.same_length:
        screen.print(Screen.styled("the runs did not end at the same time", "yellow"))


def _compare_labelled(runs: dict[str, "Run"], screen: Screen) -> int:
    """Compare every run of an overlay with the first."""
    comparisons = compare.Comparison.against_first(runs)
    screen.print(report.DifferenceTables.distances(next(iter(runs)), comparisons))
    screen.write_json({"comparisons": [comparison.to_json() for comparison in comparisons.values()]})
    return ExitCode.GOOD


def _compare_plants(log: Path, by_plant: dict[str, "Run"], screen: Screen) -> int:
    """Compare the plants of one log, judged as by the run that wrote it."""
    if len(by_plant) < 2:
        raise InputError(
            f"{log} holds the run of one plant only",
            allowed="a log of two or more plants, or two logs",
            remedy="run with --plants all, or name a second log",
        )
    pairs = compare.Agreement.pairs(list(by_plant.values()))
    runs = list({run.plant: run for pair in pairs for run in pair}.values())
    comparisons = [compare.compare_runs(*pair) for pair in pairs]
    judged = cases.CaseResult(
        tuple(cases.RunSummary.of(run, log) for run in runs),
        tuple(
            compare.judge(*pair, comparison=difference)
            for pair, difference in zip(pairs, comparisons, strict=True)
        ),
        expected=runs[0].scenario.expected,
    )
    for comparison in comparisons:
        _print(screen, comparison)
    screen.print(report.RunTables.agreement(judged.agreements))
    if (table := report.RunTables.limits([judged.runs])) is not None:
        screen.print(table)
    screen.print_each(report.RunTables.limit_notes(judged.agreements), indent="  ")
    statuses = {run.plant: run.status.label for run in judged.runs}
    for plant, status in statuses.items():
        if status != judged.expected:
            screen.print(f"  {plant} ended with {status}, expected {judged.expected}")
    screen.write_json(
        {
            "passed": judged.passed,
            "plants_agree": judged.plants_agree,
            "limits_kept": judged.limits_kept,
            "agreement": compare.Agreement.worst(judged.agreements).to_json(),
            "agreements": [agreement.to_json() for agreement in judged.agreements],
            "statuses": statuses,
            "comparisons": [comparison.to_json() for comparison in comparisons],
            "software_differences": [],
        }
    )
    return ExitCode.GOOD if judged.passed else ExitCode.LIMIT_EXCEEDED


def _judge(new_log: Path, golden_log: Path, tolerances: str, screen: Screen) -> int:
    limits = compare.Tolerances.load(tolerances)
    _check_are_two(new_log, golden_log)
    regression = cases.LogPair(new_log, golden_log).judge(limits)
    settings = regression.differing_fields.first
    screen.print_each(f"golden and new differ in {difference}" for difference in settings)
    for verdict in regression.verdicts:
        screen.print(report.DifferenceTables.regression(verdict))
    screen.print_each(
        f"not compared: {signal} of {verdict.plant}, without a number in either log"
        for verdict in regression.verdicts
        for signal in verdict.without_numbers
    )
    screen.print_each(f"not compared: {plant}, only in {new_log}" for plant in regression.added)
    screen.print_each(f"missing: {plant}, only in {golden_log}" for plant in regression.missing)
    screen.print_each(
        f"golden was made by other software: {difference}" for difference in regression.software_differences
    )
    screen.print(f"{new_log.name}:", Screen.PASSED if regression.passed else Screen.FAILED)
    screen.write_json(regression.to_json())
    return ExitCode.GOOD if regression.passed else ExitCode.LIMIT_EXCEEDED


def _check_are_two(new: Path, golden: Path) -> None:
    """Raise InputError if both names are of one file or directory."""
    if File(new).exists() and File(golden).exists() and new.samefile(golden):
        raise InputError(
            f"{new} and {golden} are one file, which agrees with itself",
            allowed="two logs, or two directories of logs",
            remedy="name another log or directory as GOLDEN",
        )


def _judge_directories(new: Path, golden: Path, tolerances: str, screen: Screen) -> int:
    """Judge the logs in and below two directories; one that only GOLDEN has fails."""
    limits = compare.Tolerances.load(tolerances)
    _check_are_two(new, golden)
    paths = [{path.relative_to(folder) for path in folder.rglob("*.mcap")} for folder in (new, golden)]
    if not paths[1]:
        raise InputError(
            f"{golden}: a directory without logs",
            allowed="directories with logs",
            remedy="name another GOLDEN",
        )
    outcomes: dict[str, cases.Regression | str] = {}
    for path in sorted(paths[1]):
        try:
            missing = path not in paths[0]
            outcomes[str(path)] = (
                "missing" if missing else cases.LogPair(new / path, golden / path).judge(limits)
            )
        except InputError as error:
            outcomes[str(path)] = error.found
    passed = all(isinstance(outcome, cases.Regression) and outcome.passed for outcome in outcomes.values())
    judged = {
        path: outcome if isinstance(outcome, str) else outcome.verdicts for path, outcome in outcomes.items()
    }
    screen.print(report.DifferenceTables.regressions(judged))
    screen.print_each(f"not compared: {path}, only in {new}" for path in sorted(paths[0] - paths[1]))
    screen.print(f"{new}:", Screen.PASSED if passed else Screen.FAILED)
    logs = {
        path: {"passed": False, "problem": outcome} if isinstance(outcome, str) else outcome.to_json()
        for path, outcome in outcomes.items()
    }
    screen.write_json({"passed": passed, "logs": logs})
    return ExitCode.GOOD if passed else ExitCode.LIMIT_EXCEEDED


def _merged(a_log: Path, b_log: Path, out: Path, despite_differences: bool) -> tuple["Run", "Run"]:
    """Write the merged log, and return the two runs that are in it."""
    runs = [list(log_files.read_log(log).values()) for log in (a_log, b_log)]
    for log, runs_of_log in zip((a_log, b_log), runs, strict=True):
        if len(runs_of_log) != 1:
            raise InputError(
                f"{log} holds the runs of {len(runs_of_log)} plants",
                allowed="logs of one plant each",
                remedy="use it as it is",
            )
    pair = compare.merged_pair(runs[0][0], runs[1][0])
    descriptions = [log_files.LogDescription.of(log) for log in (a_log, b_log)]
    if not despite_differences:
        first, second = (run.plant for run in pair)
        compare.Differences.of(*pair).refuse(f"the runs of {first} and {second} differ in", described=first)
        for description in descriptions:
            different = support.Provenance.differences(
                description.versions, support.Provenance.now(), harmless=True
            )
            problem = f"{description.path} and this installation differ in"
            compare.Differences(different).refuse(problem, described=first)
    log_files.write_log(out, pair, every=descriptions[0].every)
    return pair
