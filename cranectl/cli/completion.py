"""What a shell completes in the place of a name: scenarios, rigs, campaigns, controllers, plants, drives."""

import importlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import click
from click.shell_completion import CompletionItem

from cranectl.support import InputError, Shipped

Completer = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def completer(known: Callable[[], Iterable[str]], *, files: bool = False) -> Completer:
    """Return a function that completes the names of `known`, also after a comma, and `files` besides."""

    def complete(_context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
        before, comma, last = begun.rpartition(",")
        items = [CompletionItem(begun, type="file")] if files else []
        with suppress(InputError):  # an installed package whose names cannot be read
            names = [name for name in known() if name.startswith(last) and name not in before.split(",")]
            items += [CompletionItem(before + comma + name) for name in names]
        return items

    return complete


def _load(module: str) -> Any:
    return importlib.import_module(f"cranectl.{module}")


class Completion:
    """What a shell completes in the place of a name, by the kind of name."""

    scenarios = completer(Shipped.SCENARIOS.names, files=True)
    rigs = completer(Shipped.RIGS.names, files=True)
    campaigns = completer(Shipped.CAMPAIGNS.names, files=True)
    controllers = completer(lambda: _load("controllers.registry").controller_names(), files=True)
    plants = completer(lambda: [*_load("plants.registry").PLANTS, "all"])
    drives = completer(lambda: _load("plants.plant").DRIVES)
