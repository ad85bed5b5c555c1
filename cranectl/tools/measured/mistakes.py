"""Find the mistake in a map that explains best why measured signals do not answer each other.

Each mistake is a hypothesis: signals with a wrong factor or sign, or two columns that are exchanged. Its
remedy is applied to the signals, and all pairs are judged again. A mistake is found if its remedy makes a
pair agree that does not, makes no other pair worse, and does so better than all other remedies.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import log, pi

import numpy as np

from cranectl.scenario import RigParameters
from cranectl.support import Array
from cranectl.tools.measured.correlation import GAIN_RANGE, Response
from cranectl.tools.measured.mapping import ANGLES, COMMANDS, POSITIONS, MeasuredMap, SignalMap
from cranectl.tools.measured.responses import Responses, SignalPair

CLEAR = 0.8  # concordance of a pair that agrees
DOUBTFUL = 0.9  # concordance of a pair below which a mistake is looked for
SUSPECT = 0.99  # the same for a mistake without which next to nothing of the disagreement remains
REMAINING = 0.2  # share of the disagreement that counts as next to nothing
WORSE = 0.05  # concordance that a remedy may take from another pair
MIN_SHARE = 0.1  # of a swing that answers; in a free swing friction could seem to answer anything
MODEL_ERROR = 1e-3  # disagreement of a right map
EVEN_ODDS = log(1.5)  # of two mistakes that explain the signals alike
EXTRA_SIGNAL = 0.5  # cost of each further signal with the same mistake
ODD_FACTOR = 0.3  # cost of a factor that no unit explains
DEGREES = 180.0 / pi  # in a radian
USUAL_FACTORS = (10.0, 100.0, 1000.0, DEGREES)
SPACE = 1.5  # times the usual size that a signal may have
IMPROBABLY_SMALL = 1.0 / 50.0  # of the usual size below which a signal is improbably small
SMALL_WEIGHT = 0.5
IMPOSSIBLE = 5.0  # cost of a signal that no crane can have
MAX_TILT = 0.5  # [rad] of a rope in the middle of its swing, the zero of its sensor included
USUAL_SWING = 0.4  # [rad] of a rope on a fast crane

Columns = Sequence[Mapping[str, Array]]


@dataclass(frozen=True)
class Mistake:
    """What may be wrong in a map."""

    signals: tuple[str, ...]
    factor: float = 1.0  # by which they are too large; -1 for a sign
    exchanged: bool = False  # the columns of two signals
    with_units: bool = False  # and their units with them
    cost: float = 0.0  # of what is improbable in it

    def corrected(self, columns: Columns, sizes: Mapping[str, tuple[float, float]]) -> Columns:
        """Return the signals without this mistake; `sizes` has the SI size and the zero of readings."""
        if not self.exchanged:
            return [{**c, **{name: c[name] / self.factor for name in self.signals}} for c in columns]
        first, second = self.signals
        if self.with_units:
            return [{**c, first: c[second], second: c[first]} for c in columns]
        (size_1, zero_1), (size_2, zero_2) = sizes[first], sizes[second]
        return [
            {
                **c,
                first: size_1 * (c[second] / size_2 + zero_2 - zero_1),
                second: size_2 * (c[first] / size_1 + zero_1 - zero_2),
            }
            for c in columns
        ]

    def is_rival_of(self, other: "Mistake") -> bool:
        """Return whether the mistake is of the same kind, in other signals and no more of them."""
        return (
            self.exchanged == other.exchanged
            and not set(self.signals) & set(other.signals)
            and len(self.signals) <= len(other.signals)
        )

    def found(self, causes: Mapping[str, str]) -> str:
        """Return the mistake in words; `causes` has what each signal should answer."""
        names = " and ".join(self.signals)
        if self.exchanged:
            return f"the columns of {names} are exchanged"
        verb = "are" if len(self.signals) > 1 else "is"
        cause = causes.get(self.signals[0], "the other signals")
        what = f" for the motion of {cause}" if self.signals[0] in ANGLES else f" for {cause}"
        if self.factor < 0.0:
            verb = {"is": "swings" if self.signals[0] in ANGLES else "runs"}.get(verb, "run")
            return f"{names} {verb} the wrong way{what}"
        if abs(self.factor * DEGREES - 1.0) < 1e-3 or abs(self.factor / DEGREES - 1.0) < 1e-3:
            taken = "degrees taken for radians" if self.factor > 1.0 else "radians taken for degrees"
            what += f": {taken}" * all(name in ANGLES for name in self.signals)
        size, how = (self.factor, "large") if self.factor > 1.0 else (1.0 / self.factor, "small")
        return f"{names} {verb} {size:.4g} times too {how}{what}"

    def remedies(self, mapping: MeasuredMap) -> list[str]:
        """Return what to write in the map, one text for each signal."""
        if self.exchanged:
            names = " and ".join(f"signals.{name}" for name in self.signals)
            return [f"exchange the columns of {names}" + ", with their units" * self.with_units]
        return [_remedy(name, self.factor, mapping) for name in self.signals]


def _remedy(name: str, factor: float, mapping: MeasuredMap) -> str:
    """Return what to write for a signal that is `factor` times too large."""
    signal, units = mapping.signals.declared[name], mapping.units(name)
    if factor < 0.0:
        return f"write sign = {-signal.sign} in signals.{name}"
    right_size = units[signal.unit] / factor
    for unit, size in units.items():
        if signal.unit != "count" and unit != "count" and abs(size / right_size - 1.0) < 1e-3:
            return f"write signals.{name}.unit = '{unit}'"
    return f"write signals.{name}.scale = {signal.scale / factor:.6g}"


@dataclass(frozen=True)
class Explanation:
    """How well signals agree under a hypothesis."""

    responses: Mapping[SignalPair, Response]
    improbable: float  # cost of the sizes of signals that cranes of this rig do not have
    impossible: int  # signals that no crane can have

    @property
    def cost(self) -> float:
        """Cost of all pairs together, lower for a better explanation."""
        pairs = sum(
            log(1.0 - r.concordance + MODEL_ERROR) + _distance(r.ratio) * (r.gain_range == GAIN_RANGE)
            for r in self.responses.values()
        )
        return pairs + self.improbable


def _distance(ratio: float) -> float:
    """Return the logarithm of a gain within the range of right maps, to choose between near factors."""
    return min(abs(log(ratio)), log(2.0)) if 0.0 < ratio < np.inf else 0.0


def _without_mistake(response: Response, pair: SignalPair, mistake: Mistake) -> Response | None:
    """Return the response of a pair without a mistake, None if the signals are needed for it."""
    changed = pair.inputs & set(mistake.signals)
    linear = {pair.cause} if pair.answer in ANGLES else pair.inputs
    if (mistake.exchanged and changed) or not changed <= linear:
        return None
    cause, answer = (mistake.factor if name in changed else 1.0 for name in (pair.cause, pair.answer))
    sign = np.sign(cause * answer)
    return replace(
        response,
        correlation=float(sign * response.correlation),
        at_once=float(sign * response.at_once),
        ratio=response.ratio * abs(cause / answer),
    )


class Search:
    """Judge hypotheses on the signals of some recordings."""

    def __init__(self, responses: Responses, mapping: MeasuredMap) -> None:
        self.responses, self.mapping = responses, mapping
        self.bounds = usual_sizes(responses.rig, responses.commands)
        declared = mapping.signals.declared
        self.names = tuple(n for n in (*POSITIONS, *ANGLES, *COMMANDS) if n in declared)
        self.measured = tuple(n for n in self.names if declared[n].column is not None)
        self.sizes = {n: size_of(declared[n], mapping.units(n)) for n in self.names}
        self.holding = holding_speeds(responses)

    def judge(
        self, columns: Columns, known: Explanation | None = None, mistake: Mistake | None = None
    ) -> Explanation:
        """Judge signals; pairs of `known`, the signals with a `mistake`, are computed again where needed."""
        pairs = {}
        for pair in self.responses.pairs:
            old = _without_mistake(known.responses[pair], pair, mistake) if known and mistake else None
            pairs[pair] = old or self.responses.response(pair, columns)
        improbable = sum(self._improbable(name, columns) for name in self.names)
        return Explanation(pairs, improbable, sum(self._is_impossible(name, columns) for name in self.names))

    def _is_impossible(self, name: str, columns: Columns) -> bool:
        """Return whether no crane has such a signal: a rope of no length, or a load above its pivot."""
        if name == "rope_length":
            return any(float(c[name].min()) <= 0.0 for c in columns)
        return name in ANGLES and any(
            float(np.abs(c[name]).max()) >= 0.5 * pi or abs(float(np.median(c[name]))) > MAX_TILT
            for c in columns
        )

    def _improbable(self, name: str, columns: Columns) -> float:
        """Return the cost of the size of a signal."""
        impossible = IMPOSSIBLE * self._is_impossible(name, columns)
        largest = 0.0
        for values in (c[name] for c in columns):
            middle = float(np.median(values)) if name in ANGLES else 0.0
            size = np.ptp(values) if name in POSITIONS[:2] else np.abs(values - middle).max()
            largest = max(largest, float(size))
        share = largest / self.bounds[name]
        if share <= 0.0:
            return impossible
        return (
            impossible + max(log(share / SPACE), 0.0) + SMALL_WEIGHT * max(log(IMPROBABLY_SMALL / share), 0.0)
        )

    def candidates(self, judged: Explanation) -> Iterator[Mistake]:
        """Yield the mistakes that could explain the pairs that do not agree."""
        groups: list[tuple[str, ...]] = [(name,) for name in self.measured]
        if "rope_length" not in self.measured:
            groups.append(("rope_length",))
        has = set(self.names)
        groups += [pair for pair in zip(POSITIONS, COMMANDS, strict=True) if has.issuperset(pair)]
        groups += [group for group in (POSITIONS, ANGLES, COMMANDS) if has.issuperset(group)]
        groups += [(*POSITIONS, *COMMANDS)] * has.issuperset(COMMANDS)
        for group in groups:
            extra = EXTRA_SIGNAL * (len(group) - 1)
            if all(name in self.measured for name in group):
                yield Mistake(group, -1.0, cost=extra)
            for factor in self._factors(group[0]):
                yield Mistake(group, factor, cost=extra)
        for pair, response in judged.responses.items():
            if response.excess != 1.0 and abs(response.correlation) > DOUBTFUL:
                size = float(f"{response.ratio:.3g}")
                yield Mistake((pair.answer,), size, cost=ODD_FACTOR)
                yield Mistake((pair.cause,), 1.0 / size, cost=ODD_FACTOR)
        for pair_of in combinations(self.measured, 2):
            yield Mistake(pair_of, exchanged=True)
            same = self.mapping.units(pair_of[0]).keys() == self.mapping.units(pair_of[1]).keys()
            if same and self.sizes[pair_of[0]] != self.sizes[pair_of[1]]:
                yield Mistake(pair_of, exchanged=True, with_units=True)

    def _factors(self, name: str) -> set[float]:
        """Return the factors by which readings of a signal are often wrong."""
        units = {u: size for u, size in self.mapping.units(name).items() if u != "count"}
        own = units.get(self.mapping.signals.declared[name].unit)
        factors = {*USUAL_FACTORS, *(1.0 / factor for factor in USUAL_FACTORS)}
        return factors | ({own / size for size in units.values() if size != own} if own else set())

    def best(self, columns: Columns, judged: Explanation) -> tuple[list[Mistake], Explanation, Columns]:
        """Return the mistakes that explain the signals best, alike; none if the map may be right."""
        suspect = [pair for pair, response in judged.responses.items() if response.strict < SUSPECT]
        explained: list[tuple[float, Mistake, Explanation, Columns]] = []
        for mistake in self.candidates(judged):
            if not judged.impossible and not any(pair.inputs & set(mistake.signals) for pair in suspect):
                continue
            with np.errstate(all="ignore"):
                corrected = mistake.corrected(columns, self.sizes)
                after = self.judge(corrected, judged, mistake)
            if self._explains(mistake, judged, after):
                explained.append((after.cost + mistake.cost, mistake, after, corrected))
        if not explained:
            return [], judged, columns
        explained.sort(key=lambda entry: entry[0])
        cost, chosen, after, corrected = explained[0]
        alike = [m for c, m, *_ in explained if c < cost + EVEN_ODDS and m.is_rival_of(chosen)]
        return sorted([chosen, *alike], key=lambda m: m.signals[0] not in ANGLES), after, corrected

    def _explains(self, mistake: Mistake, before: Explanation, after: Explanation) -> bool:
        """Return whether the remedy of a mistake makes a pair agree, and no other pair worse."""
        healed = after.impossible < before.impossible
        if after.impossible > before.impossible:
            return False
        for pair, response in before.responses.items():
            was, now = response.concordance, after.responses[pair].concordance
            if now < was - WORSE:
                return False
            strict, rest = response.strict, 1.0 - after.responses[pair].strict
            nearly_all = rest < REMAINING * (1.0 - strict) and strict < SUSPECT
            is_forced = after.responses[pair].share > MIN_SHARE
            is_factor = not mistake.exchanged and abs(mistake.factor) != 1.0
            if is_factor and pair.cause in self.holding and response.ratio < 1.0:
                continue  # friction explains it too
            healed |= is_forced and now > CLEAR and (was < min(DOUBTFUL, now - 2.0 * WORSE) or nearly_all)
        return healed and after.cost + mistake.cost < before.cost - EVEN_ODDS


def holding_speeds(responses: Responses) -> dict[str, float]:
    """Return the speeds [m/s] below which friction of the rig holds an axis, by commands that it halves.

    Constant commands of twice such a speed move an axis at half of what they ask for, and smaller commands
    hardly move it. The friction is mostly assumed, but so a small answer tells of no wrong unit.
    """
    if responses.commands != "velocity" or COMMANDS[0] not in responses.columns[0]:
        return {}
    rig = responses.rig
    speeds = zip(COMMANDS, np.divide(rig.effects.friction.coulomb, rig.velocity_gains).tolist(), strict=True)
    sizes = {
        name: max(float(np.sqrt(np.mean(np.square(c[name])))) for c in responses.columns) for name in COMMANDS
    }
    return {name: speed for name, speed in speeds if sizes[name] < GAIN_RANGE * speed}


def size_of(signal: SignalMap, units: Mapping[str, float]) -> tuple[float, float]:
    """Return the size of a reading's unit with sign and scale [SI], and its zero."""
    return signal.sign * units[signal.unit] * signal.scale, signal.zero


def usual_sizes(rig: RigParameters, commands: str | None) -> dict[str, float]:
    """Return the largest size [SI] that each signal of a crane usually has."""
    width = np.ptp(rig.workspace, axis=1)
    sizes = dict(zip(POSITIONS, [width[0], width[1], rig.rope_range[1]], strict=True))
    sizes |= dict.fromkeys(ANGLES, USUAL_SWING)
    limits = getattr(rig.effects.limits, commands or "velocity")
    if commands == "force":
        limits = [max(limit, rig.weight) for limit in limits]
    sizes |= dict(zip(COMMANDS, limits, strict=True))
    return {name: float(size) for name, size in sizes.items()}
