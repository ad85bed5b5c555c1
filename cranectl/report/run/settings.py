"""What was run, and in what the runs of several logs differ: tables by setting and log."""

from collections.abc import Mapping, Sequence
from typing import Any

from cranectl.controllers.controller import LawDesign
from cranectl.report.table import Table, cells
from cranectl.scenario import changed_from_default
from cranectl.simulate import Run
from cranectl.support.documents import leaves
from cranectl.support.units import plain

Logs = Mapping[str, Mapping[str, Run]]  # by label, by plant
LONGEST = 70  # characters of a value
MANY = 12  # rows that a page folds
SAME = "Scenario, controller and drives are the same in all logs."


def what_was_run(logs: Logs, versions: Mapping[str, Mapping[str, str]]) -> tuple[Table, Table]:
    """In short, and the settings that not all logs have at their default. `versions`: by label."""
    first = [next(iter(log.values())) for log in logs.values()]
    changed = [changed_from_default(run.scenario) | _given(run) for run in first]
    facts: dict[str, list[str]] = {
        "scenario": [run.scenario.name for run in first],
        "controller": [run.controller for run in first],
        "drives": [run.drive for run in first],
        "plants": [", ".join(log) for log in logs.values()],
        "duration": [f"{run.scenario.duration:g} s" for run in first],
        "disturbances": [_text(run.scenario.disturbed_by) for run in first],
        "effects": [", ".join(run.scenario.effects.names) or "none" for run in first],
    }
    if versions:
        facts["made with"] = [
            ", ".join(f"{name} {version}" for name, version in versions[label].items()) for label in logs
        ]
    settings = {
        name: [_text(each[name]) if name in each else "default" for each in changed]
        for name in dict.fromkeys(name for each in changed for name in each)
    }
    return _by_log("", logs, facts), _by_log("Settings that are not the default", logs, settings)


def what_differs(logs: Logs) -> Table | None:
    """What is not the same in all logs, a column each; None if all is, or for a single log."""
    tables = []
    one_law = len({next(iter(log.values())).design.name for log in logs.values()}) == 1
    for log in logs.values():
        run = next(iter(log.values()))
        asked: dict[str, Any] = _parameters(run) if one_law else {}
        asked |= {"plants": list(log), "drives": run.drive, "controller": run.controller}
        tables.append(asked | {"scenario": run.scenario.model_dump(mode="json", exclude={"controller"})})
    flat = [dict(leaves(table)) for table in tables]
    names = dict.fromkeys(name for each in flat for name in each)
    differing = [name for name in names if any(each.get(name) != flat[0].get(name) for each in flat)]
    rows = {
        name.removeprefix("scenario."): [_text(each[name]) if name in each else "–" for each in flat]
        for name in differing
    }
    return _by_log("What differs", logs, rows) if rows else None


def _parameters(run: Run) -> dict[str, Any]:
    """Those of a law, by their dotted names; the flat family's are settings of [design]."""
    design = run.design
    given = design.parameters if isinstance(design, LawDesign) else {}
    return {f"controller.{design.name}.{name}": value for name, value in given.items()}


def _given(run: Run) -> dict[str, Any]:
    """Parameters of the law that the scenario gives."""
    given = run.scenario.controller.parameters.get(run.design.name, {})
    return {name: value for name, value in _parameters(run).items() if name.rpartition(".")[2] in given}


def _by_log(title: str, logs: Logs, rows: Mapping[str, Sequence[str]]) -> Table:
    """A row a name; many of them are counted and folded."""
    many = len(rows) > MANY
    shown = tuple(cells(name, *texts) for name, texts in rows.items())
    return Table(
        f"{title}: {len(rows)}" if many else title, ("", *logs), shown, labels=1 + len(logs), folded=many
    )


def _text(value: Any) -> str:
    text = plain(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
