"""Tables of `cranectl thesis`."""

from typing import TYPE_CHECKING

from rich import box
from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from cranectl.thesis import Number, Reproduction, Row

SHORT = {
    "bridge_acceleration": "ẍ_c",
    "trolley_acceleration": "ÿ_c",
    "rope_acceleration": "l̈",
    "load_x": "z₁",
    "load_y": "z₂",
    "load_z": "z₃",
    "gamma": "γ",
}


def thesis_tables(found: "Reproduction") -> list[Table]:
    """Norms and the four tables, a row a number."""
    tables = [_table("H∞ norms, section 5.2.1", found.norms)]
    tables += [_table(f"Table {t.name}, p. {t.page}: {t.title}", t.rows) for t in found.tables]
    return tables


def thesis_lines(found: "Reproduction") -> list[str]:
    """What the tables do not say: gains, what stays unexplained, what the thesis did not notice."""
    lines = [
        f"gains of {name} (not printed in the thesis): {', '.join(f'{gain:.5g}' for gain in gains)}"
        for name, gains in found.gains.items()
    ]
    open_points = {
        f"unexplained, {name} {SHORT[column]}: {number.reason}": None
        for name, _, column, number in found.numbers()
        if not number.explained
    }
    lines += list(open_points)
    lines += [
        f"not noticed in the thesis: {d.scenario}, {d.controller}: {d.violation.signal} leaves the rig at "
        f"{d.violation.first_time_s:g} s, by up to {d.violation.max_excess_m:.3f} m"
        for d in found.departures
    ]
    return lines


def _table(title: str, rows: tuple["Row", ...]) -> Table:
    table = Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    table.add_column("controller", no_wrap=True)
    table.add_column("", no_wrap=True)
    for heading in ("printed", "analytic", "MuJoCo", "velocity\ndrives", "difference", "tolerance"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        for k, (column, number) in enumerate(row.numbers.items()):
            table.add_row(row.controller if k == 0 else "", SHORT[column], *_cells(number))
    return table


def _cells(number: "Number") -> list[str]:
    ours = [
        f"{number.ours[source]:.4f}" if source in number.ours else "-"
        for source in ("analytic", "mujoco", "mujoco_velocity")
    ]
    difference = f"{number.difference:+.4f}"
    if not number.within:
        difference = f"[bold red]{difference}[/]"
    elif not number.explained:
        difference += "?"
    return [f"{number.printed:.4f}", *ours, difference, f"{number.tolerance:.4f}"]
