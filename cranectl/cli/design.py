"""`cranectl design`."""

import functools
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli.command import (
    PATH,
    Command,
    ScenarioRequest,
    json_option,
    output_option,
    scenario_options,
)
from cranectl.cli.completion import complete_controllers, complete_scenarios
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.idle import OF_MOTIONS, OF_RUNS, print_idle_in_analysis
from cranectl.cli.output import Screen
from cranectl.support.errors import InputError
from cranectl.support.files import PLOTS, write_text, writing

if TYPE_CHECKING:
    from cranectl.scenario import Scenario

# What only runs read, and what designs of the flat family do not read either.
UNREAD = (*OF_RUNS, *OF_MOTIONS, "control.physics_step", "control.lag_compensation")
OF_OTHER_CONTROLLERS = ("effects.*", "rig.effects.*", "rig.*_mass", "rig.*_time_constant", "rig.*_range.*")


@click.command("design", cls=Command)
@click.argument(
    "names",
    metavar="NAME...",
    type=ControllerName(),
    nargs=-1,
    required=True,
    shell_complete=complete_controllers,
)
@click.option(
    "--scenario",
    metavar="NAME",
    shell_complete=complete_scenarios,
    help="Whose [design], [control] and [rig] to take. Default: the defaults.",
)
@scenario_options
@output_option(
    "--plot", None, "Draw singular values, loop gains and step responses (.svg, .pdf, .png).", endings=PLOTS
)
@click.option(
    "--export",
    "directory",
    metavar="DIR",
    type=PATH,
    help="Write the controller as C99, with test vectors of a run of the scenario.",
)
@json_option
def design_command(
    names: tuple[str, ...],
    request: ScenarioRequest,
    plot: Path | None,
    directory: Path | None,
    screen: Screen,
) -> None:
    """Design one or several controllers and show what they achieve.

    Several controllers share one table, and one sheet of overlaid plots.

    \b
    cranectl design pole-placement
    cranectl design lqr+loop-shaping --plot design.svg
    cranectl design pole-placement lqr --set 'design.poles=[-3+1j, -3-1j, -4, -4]' --plot both.svg
    cranectl design lqr+loop-shaping --scenario fixed-position
    cranectl design lqr+hinf --set design.hinf.back_off=1.05 --json -
    cranectl design lqr --scenario settled-trajectory --export lqr-c
    """
    from cranectl.controllers.registry import controller_design, load_controller, only_flat
    from cranectl.report.design import (
        controller_tables,
        design_figure,
        design_tables,
        designs_figure,
        designs_table,
    )
    from cranectl.simulate import linearised_controller, tracker_of

    if directory is not None:
        _check_export(names, request, directory)
    loaded = request.read() if directory is None else request.load()
    designs = [controller_design(name, loaded) for name in dict.fromkeys(names)]
    tell = functools.partial(
        print_idle_in_analysis, screen, loaded, request, names, plant="analytic", drive="ideal"
    )
    if designs[0].axis_design is None and len(designs) == 1 and plot is None:
        controller = designs[0]
        screen.print_each(
            controller_tables(
                controller, load_controller(controller.name), linearised_controller(loaded, controller)
            )
        )
        if directory is None:
            tell(unread=UNREAD)
        else:
            _export(loaded, names[0], directory, screen)
        screen.write_json(controller.to_json())
        return
    flat = [only_flat(design) for design in designs]
    for design in flat:
        tracker_of(loaded, design)  # raises if sampling makes it unstable
    if plot is not None:
        from cranectl.report.theme import save_figure

        save_figure(design_figure(flat[0]) if len(flat) == 1 else designs_figure(flat), plot)
    screen.print_each(design_tables(flat[0]) if len(flat) == 1 else [designs_table(flat)])
    if directory is None:
        tell(unread=(*UNREAD, *OF_OTHER_CONTROLLERS))
    else:
        _export(loaded, names[0], directory, screen)
    if plot is not None:
        screen.print(f"picture: {plot}")
    results = [design.to_json() for design in flat]
    screen.write_json(results[0] if len(flat) == 1 else {"designs": results})


def _check_export(names: tuple[str, ...], request: ScenarioRequest, directory: Path) -> None:
    """Raise InputError unless one controller with a scenario goes to a new or an empty directory."""
    if request.source is None:
        raise InputError(
            "--export without --scenario",
            allowed="--export with a scenario, whose start and motion it needs",
            remedy="add --scenario fast-diagonal, or another one",
        )
    if len(set(names)) > 1:
        raise InputError(
            f"--export of {len(set(names))} controllers",
            allowed="one controller",
            remedy="export each by itself",
        )
    with writing(directory, remedy="choose another place with --export"):
        is_free = not directory.exists() or (directory.is_dir() and not any(directory.iterdir()))
    if not is_free:
        raise InputError(
            f"there is something in {directory}, or it is no directory",
            allowed="a new or an empty directory",
            remedy="choose another place with --export",
        )


def _export(scenario: "Scenario", name: str, directory: Path, screen: Screen) -> None:
    """Write the files of an exported controller."""
    from cranectl.export import exported_files
    from cranectl.loaders.c_controller import HEADER

    texts = exported_files(scenario, name)
    for file, text in {**texts, HEADER.name: HEADER.read_text(encoding="utf-8")}.items():
        with writing(directory / file, remedy="choose another place with --export"):
            directory.mkdir(parents=True, exist_ok=True)
            write_text(directory / file, text)
    screen.print(f"exported: {directory}; {directory / 'README.md'} says how to check it on the target")
