"""`cranectl design`."""

import functools
from pathlib import Path

import click

from cranectl.cli.command import Command, ScenarioRequest, json_option, output_option, scenario_options
from cranectl.cli.completion import complete_controllers, complete_scenarios
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.idle import OF_MOTIONS, OF_RUNS, print_idle_in_analysis
from cranectl.cli.output import Screen
from cranectl.support.files import PLOTS

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
@json_option
def design_command(
    names: tuple[str, ...], request: ScenarioRequest, plot: Path | None, screen: Screen
) -> None:
    """Design one or several controllers and show what they achieve.

    Several controllers share one table, and one sheet of overlaid plots.

    \b
    cranectl design pole-placement
    cranectl design lqr+loop-shaping --plot design.svg
    cranectl design pole-placement lqr --set 'design.poles=[-3+1j, -3-1j, -4, -4]' --plot both.svg
    cranectl design lqr+loop-shaping --scenario fixed-position
    cranectl design lqr+hinf --set design.hinf.back_off=1.05 --json -
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

    loaded = request.read()
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
        tell(unread=UNREAD)
        screen.write_json(controller.to_json())
        return
    flat = [only_flat(design) for design in designs]
    for design in flat:
        tracker_of(loaded, design)  # raises if sampling makes it unstable
    if plot is not None:
        from cranectl.report.theme import save_figure

        save_figure(design_figure(flat[0]) if len(flat) == 1 else designs_figure(flat), plot)
    screen.print_each(design_tables(flat[0]) if len(flat) == 1 else [designs_table(flat)])
    tell(unread=(*UNREAD, *OF_OTHER_CONTROLLERS))
    if plot is not None:
        screen.print(f"picture: {plot}")
    results = [design.to_json() for design in flat]
    screen.write_json(results[0] if len(flat) == 1 else {"designs": results})
