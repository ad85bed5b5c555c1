"""Tables and sentences about a rig, for the terminal and for pages: certificate, ladder."""

import math
from collections.abc import Sequence

from cranectl.report import Cell, Table
from cranectl.support import Quantity, Tree
from cranectl.tools.robustness.certificate.certify import Certificate, Grade, PointVerdict
from cranectl.tools.robustness.certificate.conservatism import LargestValues
from cranectl.tools.robustness.certificate.structured import DriveMargins
from cranectl.tools.robustness.ladder import LevelResult, Size
from cranectl.tools.robustness.levels import BASE, MODEL

_MARKED = {" ": "good", "f": "good", "r": "open", "u": "bad"}  # by letter of a grade, u: unstable
GRADES: dict[Grade, str] = {"gap": " ", "by frequency": "f", "refused": "r"}
MISSING = "–"


def _millimetres(metres: float, digits: int = 3) -> str:
    return f"{1e3 * metres:.{digits}g}" if math.isfinite(metres) else "none"


def _sizes(size: Size | None, digits: int = 3) -> tuple[Cell, ...]:
    """Return RMS, largest and final deviation [mm], or empty cells without one."""
    if size is None:
        return Cell.row("", "", "")
    return Cell.row(*(_millimetres(value, digits) for value in (size.rms, size.max, size.final)))


def _three(what: str) -> tuple[str, ...]:
    """Return the headings over `_sizes`."""
    return tuple(f"{what}\n{name}" for name in ("RMS", "max", "final"))


class CertificateTables:
    """Tables of a certificate."""

    @staticmethod
    def map(certificate: Certificate) -> Table:
        """Return the gap at every point: rows are rope lengths, columns are tilts and hoisting speeds."""
        loop = f"{certificate.controller}, {certificate.drive} drives, margin {certificate.margin:.3f}"
        note = "Columns: tilting disturbance [rad/s²], hoisting speed [m/s]."
        columns = list(dict.fromkeys((v.point.tilt, v.point.hoisting_speed) for v in certificate.points))
        headings = tuple(f"{d_alpha:g}, {d_beta:g}\n{speed:+g}" for (d_alpha, d_beta), speed in columns)
        at = {(v.point.rope_length, v.point.tilt, v.point.hoisting_speed): v for v in certificate.points}
        lengths = dict.fromkeys(verdict.point.rope_length for verdict in certificate.points)
        rows = []
        for length in lengths:
            verdicts = [at[length, *column] for column in columns]
            letters = [GRADES[verdict.grade] if verdict.stable else "u" for verdict in verdicts]
            gaps = zip(verdicts, letters, strict=True)
            rows.append(Cell.row(f"{length:g}", *(Cell(f"{v.gap:.3f} {of}", _MARKED[of]) for v, of in gaps)))
        return Table(f"nu-gap to the design model: {loop}", ("rope\n[m]", *headings), tuple(rows), note=note)

    @staticmethod
    def summary_lines(certificate: Certificate) -> list[str]:
        """Return where the margin is smallest, and how many points are certified."""
        worst, grades = certificate.worst, [verdict.grade for verdict in certificate.points]
        unstable = sum(not verdict.stable for verdict in certificate.points)
        return [
            f"loop opened at {certificate.opening.name}; b(G, K) = {certificate.margin:.4f} at "
            f"{worst.margin_frequency:.3g} rad/s; delay {certificate.delay:g} s",
            f"least margin by the gap {certificate.least_margin:+.4f}: gap {worst.gap:.4f} at "
            f"{worst.frequency:.3g} rad/s, {worst.point}",
            f"of {len(grades)} points certified: {grades.count('gap')} by the gap, "
            f"{grades.count('by frequency')} frequency by frequency (f); refused (r): "
            f"{grades.count('refused')}; "
            f"truly unstable (u): {unstable}",
            "This holds for the linear loop frozen at each point, not for a motion through the points.",
        ]

    @staticmethod
    def drives(margins: DriveMargins, worst: PointVerdict) -> Table:
        """Return the changes of the drives that the loop at the worst point tolerates."""
        low, high = margins.gain_range
        rows = [
            ("gain and phase, disk margin", f"{margins.disk_margin:.3f}"),
            ("gains alone", f"{Quantity(low).at_least()} … {Quantity(high).at_most()}"),
            ("phases alone", f"± {Quantity(math.degrees(margins.phase)).at_most(2)}°"),
        ]
        for spread, delay in margins.delays:
            tolerated = f"{Quantity(1e3 * delay).at_most()} ms" if delay > 0.0 else "not known"
            rows.append((f"gains ± {100 * spread:.0f} % and further delay up to", tolerated))
        title = f"The drives at once, each on its own: {worst.point}"
        return Table(title, ("what changes", "tolerated"), tuple(Cell.row(*row) for row in rows))

    @staticmethod
    def limits(limits: Sequence[LargestValues]) -> Table:
        """Return a table of certified and survived delays and lags by rope length."""
        title = "Conservatism: largest certified value, largest value that the linear loop survives"
        headings = ("rope\n[m]", "delay certified\n[ms]", "survived\n[ms]")
        rows = []
        for limit in limits:
            values = (limit.delay_certified, limit.delay_stable, limit.lag_certified, limit.lag_stable)
            # as certified
            texts = ("-" if value is None else Quantity(1e3 * value).at_most() for value in values)
            rows.append(Cell.row(f"{limit.point.rope_length:g}", *texts))
        return Table(title, (*headings, "lag certified\n[ms]", "survived\n[ms]"), tuple(rows))


class LadderTables:
    """Tables of a ladder."""

    @staticmethod
    def differences(results: Sequence[LevelResult]) -> Table:
        """Return a table with one row for each level."""
        run = results[0].run
        headings = ("level", "ended", *_three("error [mm]"), *_three("adds [mm]"), *_three("alone [mm]"),
                    "effort\n[m/s²]", "sway\n[°]")  # fmt: skip
        note = (
            "Adds: distance of the load from its place on the level before. "
            f"Alone: from {BASE}, with this effect only. "
            "Effort: RMS of the commanded accelerations. Sway: RMS angle between rope and plumb line."
        )
        last = results[-1].level
        note += f" {MODEL.capitalize()}: {last.adds}. Alone, it has only what its file has." * (
            last.name == MODEL
        )
        title = f"{run.scenario.name}, {run.design.name}: what each level adds"
        rows = tuple(Cell.row(result.level.name, *_level(result)) for result in results)
        return Table(title, headings, rows, labels=2, note=note)

    @staticmethod
    def levels(results: Sequence[LevelResult]) -> Table:
        """Return a table of what each level adds: plant, drives and the settings of its effect."""
        rows = []
        for result in results:
            level, effect = result.level, getattr(result.run.scenario.effects, result.level.name, None)
            settings = {} if effect is None else effect.model_dump(mode="json")
            numbers = ", ".join(f"{name} = {Tree(value).text()}" for name, value in settings.items())
            rows.append(Cell.row(level.name, level.adds, f"{level.plant}, {level.drive} drives", numbers))
        return Table("What is added", ("level", "adds", "plant", "settings"), tuple(rows), labels=4)


def _level(result: LevelResult) -> tuple[Cell, ...]:
    status, metrics = result.run.status, result.metrics
    at = f" at {result.run.end_s:g} s" if status.stopped else ""
    ended = Cell(f"{status.label}{at}", "bad" if status.stopped else "good")
    if metrics is None:
        return Cell.row(ended, *[MISSING] * 11)
    alone = _sizes(result.alone)
    if result.alone_status not in (None, "completed"):
        # The numbers of a run that stopped early say little: its status is shown instead.
        alone = Cell.row(Cell(str(result.alone_status), "bad"), "", "")
    errors = _sizes(Size(metrics.rms_error_m, metrics.max_error_m, metrics.final_error_m))
    effort, sway = math.hypot(*metrics.rms_acceleration_m_s2), math.degrees(metrics.rms_sway_rad)
    return Cell.row(ended, *errors, *_sizes(result.cumulative), *alone, f"{effort:.4f}", f"{sway:.3f}")
