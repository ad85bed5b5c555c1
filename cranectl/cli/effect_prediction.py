"""What `cranectl ladder --predict` prints: the error budget."""

from cranectl.cli import exit_codes
from cranectl.cli.command import ScenarioRequest
from cranectl.cli.idle import OF_RUNS, print_idle_in_analysis
from cranectl.cli.output import Screen, progress_bar

LAST_LEVEL = "friction"  # by default


def print_prediction(request: ScenarioRequest, controller: str | None, top: str, screen: Screen) -> int:
    """Predict what each effect does to the load, run it and compare; return the exit code."""
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
    print_idle_in_analysis(screen, loaded, request, [budget.controller], unread=unread)
    screen.write_json(budget.to_json())
    return exit_codes.GOOD if budget.holds else exit_codes.LIMIT_EXCEEDED
