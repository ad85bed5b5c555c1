"""Say in words how exact the numbers of the hidden cranes were, and how often the verdicts erred."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from scipy.stats import binomtest, kstest

from cranectl.tools.measured.verdict import COVERED, NOT_COVERED, NOT_DECIDED, WITHIN_TOLERANCE
from validation.proofs.hidden_cranes import DEAD_TIME, UNCHANGED

DECISIVE = 2.0  # times the tolerance or the band, from which a true difference must be found
ENOUGH_SAMPLES = 20.0  # in a swing
LEVEL = 0.05  # of unchanged runs, called not covered

Row = dict[str, Any]


def rows_of(data: Mapping[str, Any], part: str) -> list[Row]:
    """Return the judged runs of all cranes in a part of the proof; a number that JSON lacks is infinite."""
    rows = [row for facts in data["parts"].get(part, {}).values() for row in facts["rows"]]
    return [{name: inf if value is None else value for name, value in row.items()} for row in rows]


def summary(data: Mapping[str, Any]) -> dict[str, str]:
    """Return what the proof found, in words, by the name of each result."""
    words: dict[str, str] = {}
    if exact := data["parts"].get("exact"):
        words |= exactness([*exact.values()], [data["cranes"][int(k)] for k in exact])
        words |= alarms(rows_of(data, "exact"))
    for start, rows in grouped(rows_of(data, "starts"), "swing").items():
        exact_rows = [row for row in rows if row.get("crane") == "exact"]
        words[f"not covered, {start_name(start)}"] = share_of(exact_rows, NOT_COVERED)
    for condition, rows in tolerated(data).items():
        words |= {f"{condition}, {what}": text for what, text in tolerance_summary(rows).items()}
    if degenerate := rows_of(data, "degenerate"):
        wrong = [row for row in degenerate if row["answer"] not in row["allowed"]]
        words["degenerate logs, right"] = f"{len(degenerate) - len(wrong)} of {len(degenerate)}"
        words |= {f"wrong, {row['kind']}": f"{row['answer']} {row['reason']}" for row in wrong}
    if p := [row["p"] for row in rows_of(data, "calibration") if "p" in row]:
        words["calibration"] = f"Kolmogorov-Smirnov p = {kstest(p, 'uniform').pvalue:.2g} of {len(p)} runs"
    return words


def exactness(facts: Sequence[Row], truths: Sequence[Row]) -> dict[str, str]:
    """Return in words how exact the numbers are."""
    inside: list[bool] = []
    worst: dict[str, float] = {}
    late = 0.0
    for fit, truth in zip(facts, truths, strict=True):
        for name, (value, half_width) in fit["estimates"].items():
            true = truth["numbers"][name]
            inside.append(abs(value - true) <= half_width)
            worst[name] = max(worst.get(name, 0.0), abs(value - true) / abs(true))
            if name == DEAD_TIME:
                late = max(late, abs(value - true) / truth["size"] ** 0.5)
    words = {
        "converged": f"{sum(fit['converged'] for fit in facts)} of {len(facts)}",
        "numbers inside their intervals": f"{sum(inside)} of {len(inside)}",
    }
    words |= {f"largest error of {name}": f"{100.0 * error:.2f} %" for name, error in worst.items()}
    return words | {"largest error of the dead time": f"{1e6 * late:.0f} µs, over the root of the size"}


def alarms(rows: Sequence[Row]) -> dict[str, str]:
    """Return in words how often runs of each kind are not covered."""
    words = {f"not covered, {kind}": share_of(some, NOT_COVERED) for kind, some in grouped(rows).items()}
    unchanged = grouped(rows).get(UNCHANGED, [])
    alarmed = sum(row["answer"] == NOT_COVERED for row in unchanged)
    interval = binomtest(alarmed, max(len(unchanged), 1)).proportion_ci(0.95)
    words["false alarms"] = f"{100.0 * interval.low:.1f} to {100.0 * interval.high:.1f} %"
    words["rate of false alarms"] = "as allowed" if interval.low <= LEVEL else "too large"
    return words | {"false covered": str(sum(map(is_false_covered, rows)))}


def tolerated(data: Mapping[str, Any]) -> dict[str, list[Row]]:
    """Return the runs of imperfect cranes that were judged with a tolerance, by their condition."""
    conditions = {"period of 5 ms": rows_of(data, "imperfect")}
    for period, rows in grouped(rows_of(data, "periods"), "period").items():
        conditions[f"period of {1e3 * period:.0f} ms"] = rows
    for swing, rows in grouped(rows_of(data, "starts"), "swing").items():
        conditions[start_name(swing)] = [row for row in rows if "tolerance" in row]
    return {condition: rows for condition, rows in conditions.items() if rows}


def tolerance_summary(rows: Sequence[Row]) -> dict[str, str]:
    """Return in words how often answers with a tolerance are right."""
    unchanged = [row for row in rows if row["kind"] == UNCHANGED]
    decisive = [row for row in rows if row["kind"] != UNCHANGED and is_off(row, row["tolerance"])]
    fast = [row for row in rows if row.get("samples", 0.0) >= ENOUGH_SAMPLES]
    undecided = sum(row["answer"] == NOT_DECIDED for row in fast)
    return {
        "unchanged and within": share_of(unchanged, COVERED, WITHIN_TOLERANCE),
        "changed by twice the tolerance and not covered": share_of(decisive, NOT_COVERED),
        "false within": str(sum(map(is_false_within, rows))),
        "false covered": str(sum(map(is_false_covered, rows))),
        "decided of logs that are fast enough": f"{len(fast) - undecided} of {len(fast)}",
    }


def is_false_within(row: Row) -> bool:
    """Return whether the true load of a run leaves the tolerance that the answer says it keeps."""
    return row["answer"] in (COVERED, WITHIN_TOLERANCE) and bool(row["error"] > row["tolerance"])


def is_false_covered(row: Row) -> bool:
    """Return whether a changed run is called covered although it is off by more than two bands."""
    return row["kind"] != UNCHANGED and row["answer"] == COVERED and is_off(row, row["band"])


def is_off(row: Row, allowed: float) -> bool:
    """Return whether the true error of a run exceeds what is allowed more than twice."""
    return bool(row["error"] > DECISIVE * allowed)


def share_of(rows: Sequence[Row], *answers: str) -> str:
    """Return how many of the rows have one of the answers."""
    return f"{sum(row['answer'] in answers for row in rows)} of {len(rows)}"


def grouped(rows: Sequence[Row], name: str = "kind") -> dict[Any, list[Row]]:
    """Return rows by the value that they have under a name, in the order of its first use."""
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        groups.setdefault(row[name], []).append(row)
    return groups


def start_name(swing: float) -> str:
    """Return the name of runs that begin with a swing [rad]."""
    return f"start swings by {1e3 * swing:g} mrad"
