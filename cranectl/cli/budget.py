"""`cranectl budget`."""

import click

from cranectl.cli import exit_codes
from cranectl.cli.command import Command, ScenarioRequest, json_option, scenario_argument, scenario_options
from cranectl.cli.idle import OF_RUNS, tell_idle_in_analysis
from cranectl.cli.laws import controller_option
from cranectl.cli.output import Screen, progress_bar


@click.command("budget", cls=Command)
@scenario_argument
@controller_option
@click.option("--top", default="friction", show_default=True, metavar="LEVEL", help="The last level.")
@scenario_options
@json_option
def budget_command(request: ScenarioRequest, controller: str | None, top: str, screen: Screen) -> int:
    """Predict what each effect does to the load, run it and compare.

    \b
    sampled       control at the control period against control in continuous time
    engine        the physics engine's integrator against the exact equations
    servos        velocity servos that lag and feel the load
    limits        of set-points and forces
    observer      velocities and disturbances from exact positions
    noise         of the encoders
    quantisation  steps of the encoders
    delay         computing and transport
    rope          mass, elasticity
    body          a load that swings under its hook
    wind          drag and gusts
    frame         that gives way
    friction      of axes and joint

    An effect has the scenario's settings, or else the defaults. Exit code 1 if
    a measurement exceeds its bound.

    \b
    cranectl budget settled-trajectory
    cranectl budget fast-diagonal --controller lqr+hinf --set effects.delay.seconds=0.01
    cranectl budget near-slack --controller lqr --top servos --json -
    """
    from cranectl.analysis.budget.error_budget import SENSING, error_budget, simulated_seconds
    from cranectl.report.rig.tables import budget_table
    from cranectl.scenario.effects import EffectSettings

    loaded = request.load()
    with progress_bar(simulated_seconds(loaded, top), f"{loaded.name}, budget") as advance:
        budget = error_budget(loaded, controller, top=top, progress=advance)
    screen.print(budget_table(budget))
    levels = ["sensing" if entry.level in SENSING else entry.level for entry in budget.entries]
    unread = [*OF_RUNS, "metrics.*", "obstacles.*"]
    unread += [
        f"effects.{model_field}.*" for model_field in EffectSettings.model_fields if model_field not in levels
    ]
    tell_idle_in_analysis(screen, loaded, request, [budget.controller], unread=unread)
    screen.write_json(budget.to_json())
    return exit_codes.GOOD if budget.holds else exit_codes.LIMIT_EXCEEDED
