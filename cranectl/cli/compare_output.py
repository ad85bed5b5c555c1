"""What `cranectl compare` prints."""

from rich import box
from rich.table import Table
from rich.text import Text

from cranectl.cli.output import FAILED, PASSED, comparison_table
from cranectl.cli.screen import Screen, styled
from cranectl.compare import Comparison
from cranectl.compare.golden import RegressionVerdict


def print_comparison(screen: Screen, comparison: Comparison) -> None:
    """Every signal, then the largest distances."""
    screen.print(comparison_table(comparison))
    screen.print(
        f"loads at most {comparison.max_load_error_m:.3e} m apart, "
        f"at {comparison.max_load_error_at_s:g} s; "
        f"angles {comparison.max_angle_error_rad:.3e} rad; {comparison.samples} common samples",
    )
    if not comparison.same_length:
        screen.print(styled("the runs did not end at the same time", "yellow"))


def regression_table(verdict: RegressionVerdict, title: str) -> Table:
    """One row a signal, then how the runs ended."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    for heading in ("signal", "unit"):
        table.add_column(heading, no_wrap=True)
    for heading in ("max |diff|", "at [s]", "limit"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for row in verdict.signals:
        cells = (f"{row.max_abs:.1e}", f"{row.at_s:.3f}", f"{row.limit:.1e}", _verdict(row.passed))
        table.add_row(row.signal, row.unit, *cells)
    apart, limit = f"{verdict.ends_apart_s:.1e}", f"{verdict.ends_apart_limit_s:.1e}"
    table.add_row("ends apart", "s", apart, "", limit, _verdict(verdict.ends_passed))
    table.add_row(_status(verdict), "", "", "", "", _verdict(verdict.same_status))
    return table


def _status(verdict: RegressionVerdict) -> str:
    if verdict.same_status:
        return f"both {verdict.status}"
    return f"{verdict.status}, was {verdict.golden_status}"


def _verdict(passed: bool) -> Text:
    return PASSED if passed else FAILED
