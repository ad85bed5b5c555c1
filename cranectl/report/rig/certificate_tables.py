"""Tables of certificates and their summary, for the terminal and for the page of the rig."""

import math
from collections.abc import Sequence

from cranectl.analysis.advice import Assessment
from cranectl.analysis.certificate.certify import Certificate, PointVerdict
from cranectl.analysis.certificate.conservatism import Limits
from cranectl.analysis.certificate.structured import DriveMargins
from cranectl.report.table import Cell, Table, cells


def map_table(found: Certificate) -> Table:
    """The gap at every point: one row a rope length, one column a tilt and hoisting speed."""
    title = f"nu-gap to the design model: {found.controller}, {found.drive} drives, margin {found.margin:.3f}"
    note = "Columns: tilting disturbance [rad/s²], hoisting speed [m/s]."
    columns = list(dict.fromkeys((v.point.tilt, v.point.hoisting_speed) for v in found.points))
    headings = tuple(f"{d_alpha:g}, {d_beta:g}\n{speed:+g}" for (d_alpha, d_beta), speed in columns)
    at = {(v.point.rope_length, v.point.tilt, v.point.hoisting_speed): v for v in found.points}
    lengths = dict.fromkeys(verdict.point.rope_length for verdict in found.points)
    rows = (cells(f"{length:g}", *(_cell(at[length, *column]) for column in columns)) for length in lengths)
    return Table(title, ("rope\n[m]", *headings), tuple(rows), note=note)


def _cell(verdict: PointVerdict) -> Cell:
    if not verdict.stable:
        return Cell(f"{verdict.gap:.3f} u", "bad")
    letter, mark = {"gap": (" ", "good"), "by frequency": ("f", "good"), "refused": ("r", "open")}[
        verdict.grade
    ]
    return Cell(f"{verdict.gap:.3f} {letter}", mark)


def summary_lines(found: Certificate) -> list[str]:
    """Where the margin is least, and how many points are certified."""
    worst, total = found.worst, len(found.points)
    counts = {
        grade: sum(v.grade == grade for v in found.points) for grade in ("gap", "by frequency", "refused")
    }
    unstable = sum(not verdict.stable for verdict in found.points)
    return [
        f"loop cut at {found.cut.name}; b(G, K) = {found.margin:.4f} at {found.margin_frequency:.3g} rad/s; "
        f"delay {found.delay:g} s",
        f"least margin {found.margin - worst.gap:+.4f}: gap {worst.gap:.4f} at {worst.frequency:.3g} rad/s, "
        f"{worst.point}",
        f"of {total} points certified: {counts['gap']} by the gap, {counts['by frequency']} frequency by "
        f"frequency (f); refused (r): {counts['refused']}; truly unstable (u): {unstable}",
        "A statement on the linear loop frozen at each point, not on a motion through them.",
    ]


def drive_table(margins: DriveMargins, worst: PointVerdict) -> Table:
    """What the loop at the worst point tolerates in its drives."""
    low, high = margins.gain_range
    rows = [
        ("gain and phase, disk margin", f"{margins.disk_margin:.3f}"),
        ("gains alone", f"{low:.2f} … {high:.2f}"),
        ("phases alone", f"± {math.degrees(margins.phase):.0f}°"),
    ]
    for spread, delay in margins.delays:
        tolerated = f"{1e3 * delay:.1f} ms" if delay > 0.0 else "not known"
        rows.append((f"gains ± {100 * spread:.0f} % and further delay up to", tolerated))
    title = f"The three drives at once, each on its own: {worst.point}"
    return Table(title, ("what changes", "tolerated"), tuple(cells(*row) for row in rows))


def limit_table(limits: Sequence[Limits]) -> Table:
    """Delays and lags, one row a rope length."""
    title = "How conservative: largest certified, largest survived by the linear loop"
    headings = ("rope\n[m]", "delay certified\n[ms]", "survived\n[ms]")
    rows = []
    for limit in limits:
        values = (limit.delay_certified, limit.delay_stable, limit.lag_certified, limit.lag_stable)
        texts = ("-" if value is None else f"{1e3 * value:.0f}" for value in values)
        rows.append(cells(f"{limit.point.rope_length:g}", *texts))
    return Table(title, (*headings, "lag certified\n[ms]", "survived\n[ms]"), tuple(rows))


def certificates_table(assessments: Sequence[Assessment]) -> Table:
    """The certificates of several controllers, one row each."""
    rows = []
    for row in assessments:
        found = row.certificate
        grades = [point.grade for point in found.points]
        rows.append(
            cells(
                row.controller,
                found.cut.name,
                str(found.worst.point),
                f"{found.margin:.3f}",
                f"{found.worst.gap:.3f}",
                str(grades.count("gap")),
                str(grades.count("by frequency")),
                Cell(str(grades.count("refused")), "open" if "refused" in grades else ""),
                str(sum(not point.stable for point in found.points)),
            )
        )
    headings = ("controller", "cut at", "worst point", "margin b", "largest gap", "by the gap",
                "by frequency", "refused", "unstable")  # fmt: skip
    return Table("Certificates at the points that the scenario visits", headings, tuple(rows), labels=3)
