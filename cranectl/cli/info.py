"""`cranectl info`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli.command import PATH, Command, json_option, predict_option
from cranectl.cli.output import Screen

if TYPE_CHECKING:
    from cranectl.compare.agreement import Agreement
    from cranectl.log import LogDescription
    from cranectl.log.overlay import Layer
    from cranectl.simulate import Run


@click.command("info", cls=Command)
@click.argument("log", metavar="LOG", type=PATH)
@predict_option
@json_option
def info_command(log: Path, screen: Screen) -> None:
    """Say what LOG holds, what made it, and whether it is whole.

    Scenario, design, parameters, versions, topics, verdict. Every message and checksum is read; a damaged
    file is refused with the reason.

    \b
    cranectl info logs/fixed-position/lqr-ideal.mcap
    """
    from cranectl.compare.agreement import against_reference, judge, least_good
    from cranectl.log import describe_log
    from cranectl.log.overlay import is_overlay, read_layers
    from cranectl.report.run.differences import what_was_run
    from cranectl.report.run.tables import topic_table
    from cranectl.support.provenance import provenance, provenance_differences

    layers = read_layers(log)
    runs = {name: layer.run for name, layer in layers.items()}
    description = describe_log(log)
    if is_overlay(layers):
        _print_overlay(description, layers, screen)
        return
    held = list(runs.values())
    pairs = against_reference([run for run in held if len(run.time_ns)], runs)
    agreements = [judge(a, b) for a, b in pairs]
    software = provenance_differences(description.versions, provenance())
    for line in _lines(description, held, agreements, software):
        screen.print(line)
    _, settings = what_was_run({"": runs}, {})
    screen.print(settings if settings.rows else "All settings have their defaults.")
    screen.print(topic_table(description))
    screen.write_json(
        {
            **description.to_json(),
            "scenario": held[0].scenario.model_dump(mode="json"),
            "design": held[0].design.to_json(),
            "runs": [_outcome(run) for run in held],
            "agreement": least_good(agreements).to_json() if agreements else None,
            "agreements": [agreement.to_json() for agreement in agreements],
            "software_differences": software,
        },
    )


WIDEST = 4  # runs whose settings are told beside each other


def _print_overlay(description: "LogDescription", layers: Mapping[str, "Layer"], screen: Screen) -> None:
    from cranectl.cases.case import RunSummary
    from cranectl.planning.review import with_claims
    from cranectl.reference.origin import origins
    from cranectl.report.run.differences import what_differs
    from cranectl.report.run.tables import run_table, topic_table
    from cranectl.support.provenance import other_software

    made_by = {label: layer.versions for label, layer in layers.items()}
    made_of: dict[str, list[str]] = {}
    for label, layer in layers.items():
        for name, origin in origins(with_claims(layer.run.scenario)).items():
            made_of.setdefault(f"{name}: {origin}", []).append(label)
    facts = [
        ("file", description.path),
        ("overlay of", ", ".join(layers)),
        *(("reference", f"{', '.join(of)}: {origin}") for origin, of in made_of.items()),
        *(
            ("differs", f"{', '.join(of)}: {difference}")
            for difference, of in other_software(made_by).items()
        ),
        _integrity(description),
    ]
    for name, text in facts:
        screen.print(f"{name:12} {text}")
    summaries = {name: [RunSummary.of(layer.run, Path(name))] for name, layer in layers.items()}
    screen.print(run_table(summaries))
    if len(layers) <= WIDEST:
        differing = what_differs({name: {layer.run.plant: layer.run} for name, layer in layers.items()})
        screen.print(differing or "The runs were asked for with the same settings.")
    screen.print(topic_table(description))
    runs = [
        {
            "label": name,
            **_outcome(layer.run),
            "scenario": layer.run.scenario.model_dump(mode="json"),
            "design": layer.run.design.to_json(),
        }
        for name, layer in layers.items()
    ]
    screen.write_json({**description.to_json(), "runs": runs})


def _lines(
    description: "LogDescription",
    runs: Sequence["Run"],
    agreements: Sequence["Agreement"],
    software: Sequence[str],
) -> list[str]:
    """What a log is, a line a fact; `software` is what differs from what is installed."""
    from cranectl.planning.review import with_claims
    from cranectl.reference.origin import origins
    from cranectl.support.units import difference_text

    scenario = runs[0].scenario
    facts = [
        ("file", description.path),
        ("scenario", f"{scenario.name}: {scenario.title}" if scenario.title else scenario.name),
        ("design", f"{runs[0].controller}, {runs[0].drive} drives"),
    ]
    facts += [
        (run.plant, f"{run.status.label} at {run.end_s:g} s, {len(run.time_ns)} samples") for run in runs
    ]
    facts += [
        *(("reference", f"{name}: {origin}") for name, origin in origins(with_claims(scenario)).items()),
        ("disturbances", scenario.disturbed_by),
        ("effects", ", ".join(scenario.effects.names) or "none"),
        ("sampling", f"{scenario.control.period:g} s, one sample of {description.every} logged"),
    ]
    for agreement in agreements:
        load, angle = map(difference_text, (agreement.max_load_error_m, agreement.max_angle_error_rad))
        why = f": {agreement.limits}" if agreement.passed is None else ""
        who = "plants" if len(agreements) == 1 else f"{agreement.plant} and {agreement.reference}"
        facts.append(("verdict", f"{who} at most {load} m, {angle} rad apart: {agreement.verdict}{why}"))
    facts += [
        ("versions", ", ".join(f"{name} {version}" for name, version in description.versions.items())),
        *(("differs", difference) for difference in software),
        ("attachments", ", ".join(description.attachments)),
        _integrity(description),
    ]
    return [f"{name:12} {text}" for name, text in facts]


def _integrity(description: "LogDescription") -> tuple[str, str]:
    size = f"{description.size_bytes / 1e6:.1f} MB, {description.messages} messages"
    return "integrity", f"format {description.format}, {size}; checksums and counts are right"


def _outcome(run: "Run") -> dict[str, str | float]:
    return {
        "plant": run.plant,
        "drive": run.drive,
        "status": run.status.label,
        "end_s": run.end_s,
        "samples": len(run.time_ns),
    }
