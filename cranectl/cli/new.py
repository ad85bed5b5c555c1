"""`cranectl new`."""

import re
import shlex
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl import loaders
from cranectl import scenario as scenario_files
from cranectl.cli.command import Command
from cranectl.cli.counts import Count
from cranectl.cli.new_model import ModelFiles
from cranectl.cli.new_workflow import workflow_text
from cranectl.cli.output import Screen
from cranectl.report import Cell, Table
from cranectl.support import File, InputError
from cranectl.tools import measured as measured_cranes

if TYPE_CHECKING:
    from cranectl.simulate import Run

MAP = "map"  # of measured files; NAME is such a file
MODEL = "model"  # rig and scenario of a model in MJCF; NAME is the model
EXPERIMENT = "experiment"  # set-points for a crane; NAME is its rig
WORKFLOW = "workflow"  # of GitHub, for the repository in --in
TEMPLATES = Path(__file__).parent / "templates"
ENDINGS = {
    "scenario": "toml",
    "rig": "toml",
    "campaign": "toml",
    "controller": "py",
    "c-controller": "c",
    "generated-controller": "c",
}


@click.command("new", cls=Command)
@click.argument("kind", type=click.Choice([*ENDINGS, MAP, MODEL, EXPERIMENT, WORKFLOW]))
@click.argument("name")
@click.option(
    "--in",
    "directory",
    metavar="DIR",
    type=Command.PATH,
    default=Path(),
    help="Where to write. Default: here.",
)
@click.option(
    "--seed", type=Count(Count.MAX_SEED, lowest=0), metavar="N", help="Of an experiment. Default: 0."
)
@click.option(
    "--period",
    type=click.FloatRange(0.0, min_open=True),
    metavar="SECONDS",
    help="Of an experiment's set-points. Default: 0.005 on the laboratory rig, longer on larger ones.",
)
@click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Of a model: what is known, such as rig.plant.names.load=hook; repeatable.",
)
def new_command(
    kind: str,
    name: str,
    directory: Path,
    seed: int | None,
    period: float | None,
    overrides: tuple[str, ...],
) -> None:
    """Write a small working example of a file, with its test.

    NAME has lower case letters, digits and hyphens. Existing files are never replaced. The test runs
    with pytest. A controller in C comes with the header of its interface, cranectl.h.

    \b
    cranectl new scenario first-move
    cranectl new controller servo --in controllers
    cranectl new c-controller servo
    cranectl new generated-controller embedded
    cranectl new rig yard-crane
    cranectl new campaign unknown-load

    For a map of measured columns NAME is a measured file; the map suggests what its columns may be:

    \b
    cranectl new map monday.csv

    For a model NAME is a crane in MJCF. Its rig has the names that the geometry suggests, and the numbers
    and limits that the model has. A scenario moves it:

    \b
    cranectl new model mine.xml
    cranectl new model mine.xml --set rig.plant.names.load=hook

    For an experiment NAME is the rig of your crane. The files are set-points for its drives: play them,
    record the crane, and let cranectl identify fit its numbers. Each run keeps the rig's workspace and
    limits of speed and acceleration, and ends at rest. The screen shows how exact each number becomes.

    \b
    cranectl new experiment my-crane.toml
    cranectl new experiment lab-rig --seed 1 --period 0.01 --in monday

    A workflow tests on GitHub what the repository in --in has: tests, scenarios and campaigns.

    \b
    cranectl new workflow test
    """
    options = (
        ("--seed", seed, EXPERIMENT),
        ("--period", period, EXPERIMENT),
        ("--set", overrides or None, MODEL),
    )
    for option, value, of in options:
        if value is not None and kind != of:
            article = "an" if of == EXPERIMENT else "a"
            raise InputError(
                f"{option} for a {kind}", allowed=f"{option} for {article} {of}", remedy=f"leave {option} out"
            )
    if kind == EXPERIMENT:
        _propose(name, directory, seed or 0, period)
        return
    if kind == MAP:
        _write({directory / f"{Path(name).stem}-map.toml": measured_cranes.suggest_map(Path(name))})
        return
    if kind == MODEL:
        files = ModelFiles(Path(name), directory, overrides)
        _write(files.texts)
        for command in files.commands:
            click.echo(command)
        return
    InputError.check_name(kind, name)
    if kind == WORKFLOW:
        _write({directory / ".github" / "workflows" / f"{name}.yml": workflow_text(name, directory)})
        click.echo("set CRANECTL in it to a wheel or to git+URL@TAG, or as a variable of the repository")
        return
    module = name.replace("-", "_")
    stem = module if kind.endswith("controller") else name
    templates = {
        f"{stem}.{ENDINGS[kind]}": TEMPLATES / f"{kind}.{ENDINGS[kind]}.txt",
        f"test_{module}.py": TEMPLATES / f"test_{kind}.py.txt",
        **({loaders.HEADER.name: loaders.HEADER} if ENDINGS[kind] == "c" else {}),
    }
    texts = {
        directory / file: re.sub("NAME", name, re.sub("MODULE", module, template.read_text(encoding="utf-8")))
        for file, template in templates.items()
    }
    _write(texts, shared=loaders.HEADER.name)
    if ENDINGS[kind] == "c":
        source = directory / f"{stem}.c"
        click.echo(f"compile it: {loaders.compile_command(source)}")
        library = shlex.quote(str(source.with_suffix(".so")))
        click.echo(f"run it: cranectl run fast-diagonal --controller {library}")
    if find_spec("pytest") is None:
        click.echo("install pytest for the test: python -m pip install pytest")
    test = click.format_filename(directory / f"test_{module}.py")
    click.echo(f"try it: python -m pytest {shlex.quote(test)}")


def _propose(rig_name: str, directory: Path, seed: int, period: float | None) -> None:
    """Write the set-points of an experiment and the map of its recordings, and print what it tells."""
    rig, screen = scenario_files.RigFile.load(rig_name), Screen()
    name = measured_cranes.run_name(Path(rig_name).stem)
    runs = measured_cranes.Programme.runs(rig, seed=seed, period=period)
    base = Path(relpath(rig_name, directory)).as_posix() if Path(rig_name).is_file() else rig_name
    mapping = directory / f"{name}-map.toml"
    texts = {
        directory / f"{name}-run-{k}.csv": measured_cranes.Programme.set_points_text(run)
        for k, run in enumerate(runs, 1)
    }
    starts = ("{:.4g}, {:.4g} and {:.4g} m".format(*run.state.axes[0]) for run in runs)
    notes = [
        f"# Run {k} begins with bridge, trolley and rope at {place}.\n" for k, place in enumerate(starts, 1)
    ]
    _write({**texts, mapping: "".join(notes) + measured_cranes.Programme.recording_map(name, base)})
    screen.print(programme_table(runs))
    estimates, unidentifiable = measured_cranes.Programme.predict_estimates(runs[:-1], rig)
    title = f"At best, from runs 1 to {len(runs) - 1}: if the crane is as the model, with the rig's encoders"
    screen.print(measured_cranes.IdentificationReport.estimates(estimates, title))
    if unidentifiable:
        names = ", ".join(unidentifiable)
        screen.print(f"not identifiable, with intervals as large as the numbers: {names}")
    options = f"--map {shlex.quote(str(mapping))} --rig {shlex.quote(rig_name)}"
    screen.print("record each run with the columns that the map names, and identify the crane:")
    screen.print(f"  cranectl identify RECORDED*.csv {options}")


def programme_table(runs: "Sequence[Run]") -> Table:
    """Return where each run begins, how long it takes, and how fast and how far the crane moves."""
    import numpy as np

    rows = [
        Cell.row(
            str(k),
            *(f"{position:.4g}" for position in run.state.axes[0]),
            f"{run.scenario.duration:.1f}",
            *(f"{speed:.3g}" for speed in np.abs(run.commands).max(axis=0)),
            f"{np.degrees(measured_cranes.Programme.largest_swing(run).max()):.1f}",
        )
        for k, run in enumerate(runs, 1)
    ]
    starts, speeds = (
        [f"{what}\n{axis}" for axis in ("bridge", "trolley", "rope")]
        for what in ("start [m]", "top speed [m/s]")
    )
    headings = ("run", *starts, "duration [s]", *speeds, "swing [°]")
    return Table("Go to the start, let the load rest, and play the set-points", headings, tuple(rows))


def _write(texts: Mapping[Path, str], *, shared: str = "") -> None:
    """Write new files; raise InputError if one exists, but for the file `shared` with the same text."""
    for path, text in texts.items():
        same = path.name == shared and path.is_file() and path.read_text(encoding="utf-8") == text
        if File(path).exists() and not same:
            raise InputError(
                f"{path} exists", allowed="a name that is free", remedy="choose another name, or another --in"
            )
    for path, text in texts.items():
        with File(path).writing():
            path.parent.mkdir(parents=True, exist_ok=True)
            File(path).write_text(text)
        click.echo(f"written: {click.format_filename(path)}")
