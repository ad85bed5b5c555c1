"""`cranectl design`."""

from pathlib import Path

import click

from cranectl.cli.command import Command, json_option, output_option, scenario_options
from cranectl.support.files import PLOTS


@click.command("design", cls=Command)
@click.argument("name")
@click.option(
    "--scenario", metavar="NAME", help="Whose [design], [control] and [rig] to take. Default: the defaults."
)
@scenario_options
@output_option(
    "--plot", None, "Draw singular values, loop gains and step responses (.svg, .pdf, .png).", endings=PLOTS
)
@json_option
def design_command(
    name: str,
    scenario: str | None,
    rig: Path | None,
    overrides: tuple[str, ...],
    plot: Path | None,
    json_file: str | None,
) -> None:
    """Design the controller NAME and say what it achieves.

    \b
    cranectl design pole-placement
    cranectl design lqr+loop-shaping --plot design.svg
    cranectl design lqr+loop-shaping --scenario fixed-position
    cranectl design lqr+hinf --set design.hinf.back_off=1.05 --json -
    """
    from cranectl.cli.output import console, write_json
    from cranectl.controllers.registry import controller_design, load_controller, only_flat
    from cranectl.design import Design
    from cranectl.report.design_tables import design_tables, law_tables
    from cranectl.scenario import default_scenario, load_scenario
    from cranectl.simulate import linearised_law, tracker_of

    if scenario is None:
        loaded = default_scenario(rig=rig, overrides=overrides)
    else:
        loaded = load_scenario(scenario, rig=rig, overrides=overrides)
    design = controller_design(name, loaded)
    screen = console(json_file)
    if not isinstance(design, Design):
        if plot is not None:
            only_flat(design)  # raises
        for table in law_tables(design, load_controller(name), linearised_law(loaded, design)):
            screen.print(table)
        write_json(json_file, design.to_json())
        return
    tracker_of(loaded, design)  # raises if sampling makes it unstable
    if plot is not None:
        from cranectl.report.design_figures import design_figure  # matplotlib, only where it is asked for
        from cranectl.report.theme import save_figure

        save_figure(design_figure(design), plot)
    for table in design_tables(design):
        screen.print(table)
    if plot is not None:
        screen.print(f"picture: {plot}")
    write_json(json_file, design.to_json())
