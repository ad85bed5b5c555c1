"""Laws of one division, which are never in one table with those of another."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from cranectl.campaign.benchmark import scores
from cranectl.campaign.benchmark.information import information_class
from cranectl.campaign.benchmark.pieces import Division, Trial
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.standings import Standing, laws_of, set_standings
from cranectl.campaign.benchmark.table import BenchmarkTable, Runs
from cranectl.report.page import Figure, Section
from cranectl.report.table import Cell, Table, cells
from cranectl.support.arrays import Array, Mask

COMPARED = "rms_error_m"  # with the baseline, crane by crane
NAMED = ("law", "told")
TITLES: dict[Division, str] = {"tuned": "Tuned", "published": "As published (defaults)"}


class Judged(NamedTuple):
    """The laws of one division."""

    benchmark: Benchmark
    table: BenchmarkTable
    division: Division

    def piece(self, crane_set: str, scenario: str, law: str, plant: str = "") -> Trial:
        """One of the division, by default on the first plant."""
        return Trial(self.division, plant or self.benchmark.plant, crane_set, scenario, law)

    def runs(self, crane_set: str, scenario: str, law: str, plant: str = "") -> Runs | None:
        """Return those of a piece; None where it has not been run."""
        return self.table.pieces.get(self.piece(crane_set, scenario, law, plant))

    def standings(self, crane_set: str) -> list[Standing]:
        """As `set_standings`."""
        return set_standings(self.benchmark, self.table, self.division, crane_set)

    def unfinished(self, crane_set: str) -> list[str]:
        """Laws that have runs on a set, not on all scenarios of its standings."""
        shown = {each.law for each in self.standings(crane_set)}
        place = (self.division, self.benchmark.plant, crane_set)
        there = dict.fromkeys(piece.law for piece in self.table.pieces if piece[:3] == place)
        return [law for law in there if law not in shown]

    @property
    def best_first(self) -> list[str]:
        """All laws, in the order of the standings on the set with the widest spread that has any."""
        widest = sorted(self.benchmark.sets, key=lambda name: -self.benchmark.sets[name].spread)
        found = next((s for s in map(self.standings, widest) if s), [])
        return list(dict.fromkeys([*(each.law for each in found), *laws_of(self.table)]))

    def named(self, law: str) -> tuple[Cell, ...]:
        """What its rows begin with, below NAMED."""
        head = "head" if law == self.benchmark.baseline else ""
        return cells(Cell(law, head), information_class(self.table.about["laws"][law]))

    def section(
        self, anchor: str, title: str, text: str, tables: Sequence[Table], figures: Sequence[Figure] = ()
    ) -> Section:
        """A section of this division."""
        title = f"{TITLES[self.division]}: {title}"
        return Section(f"{self.division}-{anchor}", title, (text,), tuple(tables), tuple(figures))


def finite(value: float, form: str, other: str = "") -> str:
    """The number as text, `other` where there is none."""
    return format(value, form) if math.isfinite(value) else other


def median(values: Array, failed: Mask) -> str:
    """The median to three digits, failures worse than any value; empty where no run has one."""
    found = scores.median_with_failures(values, failed)
    return "" if math.isnan(found) else finite(float(f"{found:.3g}"), "g", "fails")
