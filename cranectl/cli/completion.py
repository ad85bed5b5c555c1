"""What a shell completes in the place of a name: scenarios, rigs, campaigns, controllers, plants, drives."""

from collections.abc import Callable, Iterable
from contextlib import suppress

import click
from click.shell_completion import CompletionItem

from cranectl.support import resources
from cranectl.support.errors import InputError

Completer = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def completer(known: Callable[[], Iterable[str]], *, files: bool = False) -> Completer:
    """Return a function that completes the names that `known` returns, also after a comma.

    `files`: where no name fits, the shell completes files.
    """

    def complete(_context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
        before, comma, last = begun.rpartition(",")
        items = [CompletionItem(begun, type="file")] if files else []
        with suppress(InputError):  # an installed package whose names cannot be read
            names = [name for name in known() if name.startswith(last) and name not in before.split(",")]
            items += [CompletionItem(before + comma + name) for name in names]
        return items

    return complete


def _controllers() -> Iterable[str]:
    from cranectl.controllers.registry import controller_names

    return controller_names()


def _plants() -> Iterable[str]:
    from cranectl.plants.registry import PLANTS

    return (*PLANTS, "all")


def _drives() -> Iterable[str]:
    from cranectl.plants.plant import DRIVES

    return DRIVES


complete_scenarios = completer(lambda: resources.toml_names(resources.SCENARIO_DIRECTORY), files=True)
complete_rigs = completer(lambda: resources.toml_names(resources.RIG_DIRECTORY), files=True)
complete_campaigns = completer(lambda: resources.toml_names(resources.CAMPAIGN_DIRECTORY), files=True)
complete_controllers = completer(_controllers, files=True)
complete_plants = completer(_plants)
complete_drives = completer(_drives)
