"""How far the plants are apart, beside their limits where those are known."""

from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from cranectl.compare import Agreement
from cranectl.compare.limits import Limits

SHIPPED = Limits.source  # where limits come from unless a note says otherwise
STYLES = {"passed": "green", "FAILED": "bold red"}

Drives = dict[str, tuple[Agreement, bool]]  # by name; with whether the case passed


def agreement_table(agreements: Sequence[Agreement], passed: Sequence[bool]) -> Table:
    """One row a scenario and controller, its drives side by side; `passed` says so for each agreement.

    A limit that all scenarios share stands above its column, others beside the numbers.
    """
    table = Table(title="Agreement of the plants", title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    table.add_column("controller", no_wrap=True)
    shared = {drive: _shared([a for a in agreements if a.drive == drive]) for drive in _drives(agreements)}
    for drive, limits in shared.items():
        for what, limit in zip(("load [m]", "angle [rad]"), limits or (None, None), strict=True):
            heading = f"{drive}\n{what}" + ("" if limit is None else f"\n< {limit:.3g}")
            table.add_column(Text(heading), justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    rows: dict[tuple[str, str], Drives] = {}
    for agreement, good in zip(agreements, passed, strict=True):
        rows.setdefault((agreement.scenario, agreement.controller), {})[agreement.drive] = (agreement, good)
    last = ""
    for (scenario, controller), drives in rows.items():
        if scenario != last:
            table.add_row(Text(scenario, "bold"))
            last = scenario
        cells: list[Text] = []
        for drive, limits in shared.items():
            found = drives.get(drive)
            cells += _apart(found[0], beside=limits is None) if found else [Text("-"), Text("-")]
        table.add_row(Text(f" {controller}"), *cells, _verdict(drives))
    return table


def limit_notes(agreements: Sequence[Agreement]) -> list[str]:
    """Of which scenarios the limits are their own, and which have none, and why."""
    where: dict[tuple[bool, str, str], dict[str, None]] = {}
    for found in agreements:
        if found.limits != SHIPPED:
            where.setdefault((found.passed is None, found.drive, found.limits), {})[found.scenario] = None
    return [
        f"{', '.join(names)}, {drive} drives: {'not judged' if unjudged else 'limits'}: {why}"
        for (unjudged, drive, why), names in where.items()
    ]


def _drives(agreements: Sequence[Agreement]) -> list[str]:
    return list(dict.fromkeys(agreement.drive for agreement in agreements))


def _shared(agreements: Sequence[Agreement]) -> tuple[float, float] | None:
    """The limits that all have, if they have the same."""
    (first, *others) = {(agreement.limit_m, agreement.limit_rad) for agreement in agreements}
    load_m, angle_rad = first
    return None if others or load_m is None or angle_rad is None else (load_m, angle_rad)


def _apart(agreement: Agreement, *, beside: bool) -> list[Text]:
    cells = []
    for value, limit in (
        (agreement.max_load_error_m, agreement.limit_m),
        (agreement.max_angle_error_rad, agreement.limit_rad),
    ):
        text = f"{value:.1e} < {limit:.1e}" if beside and limit is not None else f"{value:.1e}"
        # Not a number keeps no limit.
        cells.append(Text(text, "" if limit is None or value <= limit else "bold red"))
    return cells


def _verdict(drives: Drives) -> Text:
    """Of one row: of the drives that are judged, named if others are not."""
    judged = [drive for drive, (agreement, _) in drives.items() if agreement.passed is not None]
    word = "passed" if all(good for _, good in drives.values()) else "FAILED"
    if word == "passed" and not judged:
        return Text("not judged", "yellow")
    aside = "" if len(judged) == len(drives) or word == "FAILED" else f" ({', '.join(judged)})"
    return Text.assemble((word, STYLES[word]), aside)
