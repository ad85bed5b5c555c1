"""Identify hidden cranes, and judge new runs: how exact the numbers are, and how often answers are wrong.

    .venv/bin/python -m validation.proofs.identification --truth    # hide cranes, by a new seed; commit it
    .venv/bin/python -m validation.proofs.identification --jobs 2   # all parts, into identification.json
    .venv/bin/python -m validation.proofs.identification --part exact --cranes 2

Each crane has another size, from 1 to 25 times the laboratory rig's, and other numbers than those from which
the fit starts. The simulator shares nothing with the models (tests/tools/measured/simulator.py). The truth is
written before any run, and no part runs without it. What is in the file is not computed again; fits are kept
in build/.

- exact: cranes that the models describe; and nine changes of each
- imperfect: each crane has some flaws that no model has; and nine changes of it
- periods: the same from logs that are up to 20 times slower; a period of 100 ms is too slow for a swing of
  1.7 s. Periods grow with the root of the size, as swings do
- starts: runs that begin with a swing of 0, 1 and 5 mrad
- degenerate: logs that say nothing, or that were used
- calibration: unchanged runs of further cranes, whose probabilities must be even from 0 to 1. Runs of one
  crane share the errors of its fit, so there are many cranes
"""

import argparse
import json
import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from itertools import chain
from math import pi, sqrt
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from cranectl.scenario.load import RigFile
from cranectl.simulate import Run
from cranectl.support.errors import InputError
from cranectl.tools.measured.fit import Fit
from cranectl.tools.measured.identification import identify
from cranectl.tools.measured.verdict import (
    COVERED,
    NOT_DECIDED,
    RunVerdict,
    answer_for,
    judge,
)
from tests.tools.measured.disguises import disguises
from tests.tools.measured.hidden import run_of, set_points
from tests.tools.measured.simulator import NO_DEFECTS, Defects, Truth
from validation.proofs.hidden_cranes import (
    CRANES,
    PERIOD,
    SECONDS,
    UNCHANGED,
    Crane,
    Numbers,
    changes,
    drawn_crane,
)
from validation.proofs.identification_results import summary

DATA = Path(__file__).with_name("identification.json")
FITS = Path(__file__).resolve().parents[2] / "build" / "identification"
FITTED = 4  # runs
EXACT_UNCHANGED, IMPERFECT_UNCHANGED, FEW_UNCHANGED = 17, 4, 2  # judged runs of each crane
FEW_CHANGES = 3  # of the nine, in turn from crane to crane
SLOW_PERIODS = (0.02, 0.05, 0.1)  # [s] on the laboratory rig, besides PERIOD
SWINGS = (0.0, 0.001, 0.005)  # [rad] at the start
USUAL_SWING = 0.001  # [rad] of imperfect cranes
CALIBRATED, CALIBRATION_RUNS = 40, 5  # cranes, and judged runs of each
SHORT = 8.0  # [s] of a run of the calibration, on the laboratory rig
REFUSED = "refused"

Row = dict[str, Any]


class Fitted:
    """A crane with the fit to some runs of it, which is kept."""

    def __init__(
        self, crane: Crane, k: int, folder: Path, name: str, has: Defects, *, period: float = PERIOD,
        swing: float = 0.0, **more: Any,
    ) -> None:  # fmt: skip
        self.crane, self.k, self.has = crane, k, has
        self.common: dict[str, Any] = {"period": period, "swing": swing}
        path = crane.rig_file(folder, f"{name}-{k}")  # of this crane alone: others run at the same time
        self.rig = RigFile.load(str(path))
        if not Fit.path(path).exists():
            runs = [self.run(seed, **more)[0] for seed in range(FITTED)]
            result = identify(runs, self.rig)
            shown = {
                "misfit": result.misfit,
                "converged": result.converged,
                "estimates": {e.name: [e.value, e.half_width] for e in result.estimates},
            }
            path.with_suffix(".json").write_text(json.dumps(shown), encoding="utf-8")
            Fit.path(path).write_text(Fit.text(result, runs), encoding="utf-8")
        self.fit: Fit = Fit.read(path)
        self.facts: Row = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))

    def run(self, seed: int, **more: Any) -> tuple[Run, Truth]:
        """Return a run of this crane; seeds below FITTED are those of the fit."""
        kept = {"changed": (self.crane.numbers, self.has), **self.common, **more}
        return self.crane.run(self.rig, 100_000 * self.k + seed, **kept)

    def changes(self) -> dict[str, tuple[Numbers, Defects]]:
        """Return nine changes of the crane."""
        return changes(self.crane, self.rig, self.has)

    def some_changes(self) -> dict[str, tuple[Numbers, Defects]]:
        """Return some of them, others for the next crane."""
        kinds = [*self.changes().items()]
        return dict(kinds[(FEW_CHANGES * self.k + n) % len(kinds)] for n in range(FEW_CHANGES))

    def judged(self, first: int, kinds: Sequence[tuple[str, Row]]) -> Iterator[tuple[Row, RunVerdict | None]]:
        """Yield a row and the verdict of a new run of each kind, which has other settings of a run."""
        for n, (kind, settings) in enumerate(kinds):
            run, truth = self.run(first + n, **settings)
            yield judged_row(kind, run, self.fit, truth)

    def with_tolerance(
        self, first: int, unchanged: int, changed: Mapping[str, tuple[Numbers, Defects]], **settings: Any
    ) -> list[Row]:
        """Return rows of new runs, judged with the tolerance that unchanged ones have, and two bands."""
        kinds = [(UNCHANGED, settings)] * unchanged
        kinds += [(kind, {**settings, "changed": change}) for kind, change in changed.items()]
        judged = [*self.judged(first, kinds)]
        errors = [row["error"] for row, _ in judged if row["kind"] == UNCHANGED]
        bands = [verdict.band for row, verdict in judged if row["kind"] == UNCHANGED and verdict]
        tolerance = max(errors, default=0.0) + 2.0 * max(bands, default=0.0)
        for row, verdict in judged:
            row["tolerance"] = tolerance
            if verdict:
                row["answer"], row["reason"] = answer_for(verdict, tolerance)
        return [row for row, _ in judged]


def judged_row(kind: str, run: Run, fit: Fit, truth: Truth | None = None) -> tuple[Row, RunVerdict | None]:
    """Return what a verdict says of a run, beside the truth."""
    try:
        (verdict,) = judge({kind: run}, fit)
    except InputError as error:
        return {"kind": kind, "answer": REFUSED, "reason": error.found, "error": 0.0}, None
    row: Row = {
        "kind": kind,
        "answer": verdict.answer,
        "reason": verdict.reason,
        "p": verdict.probability,
        "T": verdict.statistic,
        "band": verdict.band,
        "noise": verdict.load.noise,
        "shown": verdict.largest,
    }
    if truth is not None:
        predicted = np.nan_to_num(verdict.load.predicted, nan=np.inf)
        for name, place in (("error", truth.sensed), ("unseen", truth.load)):
            row[name] = float(np.linalg.norm(place - predicted, axis=1).max())
        rope = float((truth.joints[:, 2]).min())
        row["samples"] = 2.0 * pi * sqrt(rope / fit.rig.gravity) / float(run.time[1])
    return row, verdict


def exact_part(crane: Crane, k: int, folder: Path) -> Row:
    """Judge unchanged runs of an exact crane, and nine changes of it."""
    fitted = Fitted(crane, k, folder, "exact", NO_DEFECTS)
    kinds: list[tuple[str, Row]] = [(UNCHANGED, {})] * EXACT_UNCHANGED
    kinds += [(kind, {"changed": change}) for kind, change in fitted.changes().items()]
    return {**fitted.facts, "rows": [row for row, _ in fitted.judged(100, kinds)]}


def imperfect_part(crane: Crane, k: int, folder: Path) -> Row:
    """Judge runs of an imperfect crane with a tolerance."""
    fitted = Fitted(crane, k, folder, "imperfect", crane.flaws, swing=USUAL_SWING)
    return {**fitted.facts, "rows": fitted.with_tolerance(200, IMPERFECT_UNCHANGED, fitted.changes())}


def periods_part(crane: Crane, k: int, folder: Path) -> Row:
    """Judge runs of an imperfect crane, all in slow logs."""
    facts: Row = {"rows": []}
    for n, period in enumerate(SLOW_PERIODS):
        name = f"period-{1e3 * period:.0f}"
        fitted = Fitted(crane, k, folder, name, crane.flaws, period=period, swing=USUAL_SWING)
        rows = fitted.with_tolerance(300 + 20 * n, FEW_UNCHANGED, fitted.some_changes())
        facts["rows"] += [{**row, "period": period} for row in rows]
    return facts


def starts_part(crane: Crane, k: int, folder: Path) -> Row:
    """Judge runs that begin with a swing, of an exact crane and of an imperfect one."""
    exact = Fitted(crane, k, folder, "exact", NO_DEFECTS)
    imperfect = Fitted(crane, k, folder, "imperfect", crane.flaws, swing=USUAL_SWING)
    facts: Row = {"rows": []}
    for n, swing in enumerate(SWINGS):
        new: list[tuple[str, Row]] = [(UNCHANGED, {"swing": swing})] * FEW_UNCHANGED
        rows = [{**row, "crane": "exact"} for row, _ in exact.judged(400 + 20 * n, new)]
        some = imperfect.some_changes()
        rows += imperfect.with_tolerance(410 + 20 * n, FEW_UNCHANGED, some, swing=swing)
        facts["rows"] += [{**row, "swing": swing} for row in rows]
    return facts


def degenerate_part(crane: Crane, k: int, folder: Path) -> Row:
    """Judge logs that say nothing, and logs that were used."""
    fitted = Fitted(crane, k, folder, "exact", NO_DEFECTS)
    rig, period, rng = fitted.rig, crane.period(), np.random.default_rng(k)
    time = period * np.arange(round(SECONDS / PERIOD) + 1)
    start, _ = set_points(rig, rng, time, ())
    still, rows = np.zeros((len(time), 3)), []

    def add(kind: str, allowed: Sequence[str], make: Callable[[], tuple[Run, Fit, Truth | None]]) -> None:
        try:
            row, _ = judged_row(kind, *make())
        except InputError as error:
            row = {"kind": kind, "answer": REFUSED, "reason": error.found}
        rows.append({**row, "allowed": allowed})

    constant = np.tile([*start, 0.0, 0.0], (len(time), 1))
    add("constant", [NOT_DECIDED], lambda: (run_of(rig, time, constant, still), fitted.fit, None))
    short = time[:2], constant[:2], still[:2]
    add("two samples", [REFUSED], lambda: (run_of(rig, *short), fitted.fit, None))
    for swing in (0.0, 0.005):
        rest = partial(fitted.run, 500, motion=(start, still), swing=swing)
        name = f"zero commands, swing of {1e3 * swing:g} mrad"
        add(
            name,
            [NOT_DECIDED, COVERED] if swing else [NOT_DECIDED],
            lambda rest=rest: with_fit(rest(), fitted),
        )
    for axis, name in enumerate(("bridge", "trolley", "rope")):
        one = partial(fitted.run, 510 + axis, axes=(axis,))
        add(f"only {name} moves", [COVERED], lambda one=one: with_fit(one(), fitted))
    lame = Fitted(crane, k, folder, "one-axis", NO_DEFECTS, axes=(1,))
    add("an axis that the fit never saw", [NOT_DECIDED], lambda: with_fit(lame.run(520), lame))
    used, _ = fitted.run(0)
    for name, run in chain([("used", used)], disguises(used)):
        add(name, [REFUSED], lambda run=run: (run, fitted.fit, None))
    return {"rows": rows}


def with_fit(done: tuple[Run, Truth], fitted: Fitted) -> tuple[Run, Fit, Truth]:
    """Return a run, the fit that judges it, and the truth."""
    return done[0], fitted.fit, done[1]


def calibration_part(crane: Crane, k: int, folder: Path) -> Row:
    """Judge short unchanged runs of an exact crane."""
    fitted = Fitted(crane, k, folder, "short", NO_DEFECTS, seconds=SHORT)
    kinds: list[tuple[str, Row]] = [(UNCHANGED, {"seconds": SHORT})] * CALIBRATION_RUNS
    return {"rows": [row for row, _ in fitted.judged(600, kinds)]}


PARTS: dict[str, Callable[[Crane, int, Path], Row]] = {
    "exact": exact_part,
    "imperfect": imperfect_part,
    "periods": periods_part,
    "starts": starts_part,
    "degenerate": degenerate_part,
    "calibration": calibration_part,
}


def run_part(part: str, k: int, crane: Row, folder: Path) -> tuple[int, Row]:
    """Return the result of a part for the k-th crane."""
    return k, PARTS[part](Crane.from_json(crane), k, folder)


def hide(seed: int, out: Path) -> None:
    """Write the truth of new cranes, in place of all results."""
    with TemporaryDirectory() as folder:
        cranes = [drawn_crane(seed, k, Path(folder)).to_json() for k in range(CALIBRATED)]
    write({"seed": seed, "cranes": cranes, "parts": {}}, out)


def write(data: Row, out: Path) -> None:
    """Write the truth and the results, a line for each crane and each row, with six digits in results."""
    text = json.dumps(data["parts"])
    rounded = json.loads(text, parse_float=_six_digits, parse_constant=lambda _: None)
    parts = []
    for part, cranes in sorted(rounded.items()):
        units = [
            json.dumps({n: v for n, v in facts.items() if n != "rows"})[:-1]
            + (", " if len(facts) > 1 else "")
            + '"rows": [\n   '
            + ",\n   ".join(map(json.dumps, facts["rows"]))
            + "]}"
            for facts in cranes.values()
        ]
        numbered = (f'"{k}": {text}' for k, text in zip(cranes, units, strict=True))
        parts.append(f' "{part}": {{\n  ' + ",\n  ".join(numbered) + "}")
    cranes, whole = ",\n  ".join(map(json.dumps, data["cranes"])), ",\n".join(parts)
    text = f'{{"seed": {data["seed"]},\n "cranes": [\n  {cranes}],\n "parts": {{\n{whole}}}}}\n'
    out.write_text(text, encoding="utf-8")


def _six_digits(text: str) -> float:
    return float(f"{float(text):.6g}")


def main() -> None:
    """Hide cranes, or run what is missing, and tell the results."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--truth", action="store_true", help="hide new cranes; the old results are lost")
    parser.add_argument("--seed", type=int, help="of --truth; by default one that nobody knows before")
    parser.add_argument("--part", choices=PARTS, action="append", help="by default all")
    parser.add_argument(
        "--cranes", type=int, help=f"how many of them; by default {CRANES}, and {CALIBRATED} for calibration"
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=DATA)
    arguments = parser.parse_args()
    if arguments.truth:
        hide(secrets.randbelow(2**31) if arguments.seed is None else arguments.seed, arguments.out)
        return
    data = json.loads(arguments.out.read_text(encoding="utf-8"))
    if "cranes" not in data:
        parser.error(f"{arguments.out} has no truth; write it by --truth, and commit it")
    folder = FITS / str(data["seed"])
    folder.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(arguments.jobs, mp_context=get_context("spawn")) as pool:
        for part in arguments.part or PARTS:  # in turn, since parts of a crane share its fits
            done = data["parts"].get(part, {})
            cranes = arguments.cranes or (CALIBRATED if part == "calibration" else CRANES)
            missing = [k for k in range(cranes) if str(k) not in done]
            tasks = [pool.submit(run_part, part, k, data["cranes"][k], folder) for k in missing]
            for task in as_completed(tasks):
                k, facts = task.result()
                done = dict(sorted([*done.items(), (str(k), facts)], key=lambda item: int(item[0])))
                data["parts"][part] = done
                print(f"{part}, crane {k}: {shown_answers(facts['rows'])}", flush=True)
                write(data, arguments.out)
    data = json.loads(arguments.out.read_text(encoding="utf-8"))
    print("\n".join(f"{name}: {value}" for name, value in summary(data).items()))


def shown_answers(rows: Sequence[Row]) -> str:
    """Return how many runs had each answer."""
    answers = [row["answer"] for row in rows]
    return ", ".join(f"{answers.count(answer)} {answer}" for answer in dict.fromkeys(answers))


if __name__ == "__main__":
    main()
