"""Check the signals of a map against physics, over all logs of the map together.

Each angle answers its axis, and each axis its command. `responses` computes how, `mistakes` finds which
mistake in the map explains what does not fit. An answer that is late has a clock that is late.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from cranectl.scenario import RigParameters
from cranectl.support import Array, InputError, JSONRecord
from cranectl.tools.measured.correlation import GAIN_RANGE, Response
from cranectl.tools.measured.mapping import ANGLES, COMMANDS, MIN_ROPE, POSITIONS, MeasuredMap
from cranectl.tools.measured.mistakes import Columns, Search
from cranectl.tools.measured.responses import MAX_LATENESS, Recording, Responses, SignalPair

FAST = 3.0  # times the drive's speed limit at which a jump is refused
STEPS_PER_JUMP = 3.0  # steps of an encoder that a reading may jump at any speed
MIN_LATENESS = 0.03  # of the time 1/w of the pendulum, from which an answer counts as late
LATE_SHARE = 0.5  # of the disagreement that may remain without the delay
LATE_CLEAR = 0.95  # correlation from which an answer is refused as late
NO_ANSWER = 0.5  # correlation below which a signal does not answer
LARGE_MEAN = 0.01  # [rad] of an angle, from which its zero is questioned
DELAYS, DELAY_ROUNDS = 11, 3  # that are tried, each round between the neighbours of the best
SHOWN_DELAY = 1e-3  # [s]
MAX_MISTAKES = 4  # in one message


def check_motion(name: str, time: Array, values: Array, rig: RigParameters) -> None:
    """Raise InputError for positions that jump faster than drives can move, and for impossible angles."""
    if name in ANGLES:
        largest = float(np.abs(values).max())
        if largest >= 0.5 * pi:
            raise InputError(
                f"{name} reaches {largest:.4g} rad",
                allowed="angles within pi/2",
                remedy=f"write signals.{name}.unit = 'deg' if the readings are degrees, or set zero or scale",
            )
        return
    if name not in POSITIONS or len(values) < 2:
        return
    limit = FAST * float(rig.effects.limits.velocity[POSITIONS.index(name)])
    # Two time stamps may be closer than the two readings were taken.
    steps, times = np.abs(np.diff(values)), np.diff(time).clip(min=float(np.median(np.diff(time))))
    moving = steps[steps > 0.0]
    resolution = float(np.median(moving)) if len(moving) else 0.0
    excess = steps - limit * times - STEPS_PER_JUMP * resolution
    worst = int(np.argmax(excess))
    if excess[worst] > 0.0:
        raise InputError(
            f"{name} jumps by {steps[worst]:.4g} m in {times[worst]:.4g} s, at "
            f"{time[worst] - time[0]:.6g} s of the part",
            allowed=f"speeds up to {limit:.3g} m/s, {FAST:g} times what the rig's drive can do",
            remedy=f"check signals.{name}.unit and scale, leave the jump out by from and to, or correct "
            "effects.limits.velocity of the rig",
        )
    if name == "rope_length" and float(values.min()) < MIN_ROPE:
        raise InputError(
            f"rope_length is {values.min():.4g} m",
            allowed=f"lengths of at least {MIN_ROPE:g} m",
            remedy="set zero or sign of signals.rope_length, or a constant value if nobody measured the rope",
        )


@dataclass(frozen=True)
class Finding(JSONRecord):
    """How one signal answers another, or what contradicts physics."""

    signal: str
    cause: str
    correlation: float  # of both, from -1 to 1; NaN if one of them hardly moves
    gain: float  # 1 for a right mapping
    delay: float  # [s] by which the answer is late
    mean: float = 0.0  # [rad] of an angle; a load that comes to rest hangs at 0
    held_below: float = 0.0  # [m/s] of commands that the rig's friction may make ineffective

    @property
    def text(self) -> str:
        """The finding as a sentence."""
        if np.isnan(self.correlation):
            return f"{self.signal} or {self.cause} hardly moves, so nothing is known of their mapping"
        offset = f"; its mean is {self.mean:.3g} rad: is its zero right?" * (abs(self.mean) > LARGE_MEAN)
        if self.held_below:
            offset += f"; the rig's friction would hold the axis at commands below {self.held_below:.3g} m/s"
        if abs(self.correlation) < NO_ANSWER:
            return f"{self.signal} does not answer {self.cause}: correlation {self.correlation:.2f}{offset}"
        sign = "; a negative gain: is one of both signs inverted?" * (self.gain < 0.0)
        late = f", {self.delay:.3g} s late" if abs(self.delay) >= SHOWN_DELAY else ""
        return (
            f"{self.signal} answers {self.cause} with correlation {self.correlation:.2f} and "
            f"gain {self.gain:.3g} (1 and 1 for exact readings){late}{sign}{offset}"
        )


@dataclass(frozen=True)
class PhysicsVerdict:
    """What physics says of a map."""

    findings: tuple[Finding, ...]
    contradictions: tuple[str, ...] = ()  # what is wrong
    remedies: tuple[str, ...] = ()  # what to write in the map
    useless: str = ""  # why nothing could be checked, or nothing answers

    def refuse(self, of: str = "") -> None:
        """Raise InputError if the map contradicts physics, in the file `of` if not in all together."""
        if self.contradictions:
            raise InputError(
                f"{of}{': ' * bool(of)}the map contradicts physics: {'; '.join(self.contradictions)}",
                allowed="a rope that swings back against the acceleration of its pivot, and axes that follow "
                "their commands",
                remedy=f"{'; '.join(self.remedies)}; or accept the files by check_physics = false in the map",
            )


def check_physics(
    recordings: Sequence[Recording], mapping: MeasuredMap, rig: RigParameters
) -> PhysicsVerdict:
    """Judge a map by the signals of its logs: signs, factors, exchanged columns and delays."""
    responses = Responses(recordings, rig, mapping.commands)
    search = Search(responses, mapping)
    columns: Columns = responses.columns
    judged = search.judge(columns)
    findings = tuple(
        _finding(pair, response, responses, search.holding) for pair, response in judged.responses.items()
    )
    causes = {pair.answer: pair.cause for pair in reversed(responses.pairs)}
    contradictions, remedies = [], []
    for _ in range(MAX_MISTAKES):
        alike, judged, columns = search.best(columns, judged)
        if not alike:
            break
        contradictions.append(" or ".join(mistake.found(causes) for mistake in alike))
        remedies.append(_either([mistake.remedies(mapping) for mistake in alike]))
    if not contradictions:
        for name, delay in _late_signals(responses, judged.responses).items():
            own = mapping.signals.declared[name].delay
            contradictions.append(f"{name} is {delay:.3g} s late")
            remedies.append(f"write signals.{name}.delay = {own + delay:.3g}")
    constants = {name for name, signal in mapping.signals.declared.items() if signal.column is None}
    shown = tuple(finding for finding in findings if not {finding.signal, finding.cause} <= constants)
    return PhysicsVerdict(shown, tuple(contradictions), tuple(remedies), _useless(findings))


def _either(texts: Sequence[Sequence[str]]) -> str:
    """Return the remedies of mistakes that explain the signals alike."""
    return ", or ".join(" and ".join(text) for text in texts)


def _finding(
    pair: SignalPair, response: Response, responses: Responses, holding: Mapping[str, float]
) -> Finding:
    mean = 0.0
    if pair.answer in ANGLES:
        mean = float(np.mean(np.concatenate([c[pair.answer] for c in responses.columns])))
    if not (responses.moves(pair.answer) and responses.moves(pair.cause)):
        return Finding(pair.answer, pair.cause, np.nan, np.nan, 0.0, mean)
    held_below = holding.get(pair.cause, 0.0) if response.ratio < 1.0 / GAIN_RANGE else 0.0
    return Finding(
        pair.answer, pair.cause, response.correlation, response.gain, response.delay, mean, held_below
    )


def _useless(findings: Sequence[Finding]) -> str:
    """Return why the map could not be checked, or an empty text."""
    if not findings:
        return "nothing was checked: the map has neither angles nor commands"
    moving = [finding for finding in findings if not np.isnan(finding.correlation)]
    if not moving:
        return "this log is of no use: no signal moves together with another, so nothing was checked"
    if all(abs(finding.correlation) < NO_ANSWER for finding in moving):
        best = max(moving, key=lambda finding: abs(finding.correlation))
        return (
            f"this log is of no use: no signal answers another; the best correlation is "
            f"{best.correlation:.2f}, of {best.signal} and {best.cause}"
        )
    return ""


def _late_signals(responses: Responses, judged: Mapping[SignalPair, Response]) -> dict[str, float]:
    """Return the signals whose clock is late, and by how much [s].

    A rope cannot answer before its pivot moves, and no axis before its command. So an answer that is early
    tells of a cause that is late. A drive may be late itself, by the rig's time constant if that is known.
    """
    late: dict[str, float] = {}
    least = MIN_LATENESS / responses.frequency
    for pair, response in judged.items():
        is_drive = pair.cause in COMMANDS
        is_late_drive = is_drive and response.delay > 0.0
        if response.correlation < LATE_CLEAR or abs(response.delay) < 0.25 * least or is_late_drive:
            continue
        names = (pair.cause,) if is_drive else (pair.answer, pair.cause)
        rest, delay, name = min((*_fitted_delay(responses, pair, name), name) for name in names)
        if delay > least and rest < LATE_SHARE * (1.0 - response.at_once):
            late.setdefault(name, delay + (responses.drive_lag(name) if is_drive else 0.0))
    return late


def _fitted_delay(responses: Responses, pair: SignalPair, name: str) -> tuple[float, float]:
    """Return the disagreement of a pair if one of its signals is late, and by how much that is [s]."""

    def disagreement(delay: float) -> float:
        columns = [
            {**c, name: _shifted(c[name], delay / period)}
            for c, period in zip(responses.columns, responses.periods, strict=True)
        ]
        return 1.0 - responses.response(pair, columns).at_once

    low, high = 0.0, MAX_LATENESS / responses.frequency
    for _ in range(DELAY_ROUNDS):
        delays = np.linspace(low, high, DELAYS)
        values = [disagreement(float(delay)) for delay in delays]
        best = int(np.argmin(values))
        low, high = float(delays[max(best - 1, 0)]), float(delays[min(best + 1, DELAYS - 1)])
    return values[best], float(delays[best])


def _shifted(values: Array, samples: float) -> Array:
    """Return a signal earlier by so many samples."""
    rows = np.arange(len(values), dtype=np.float64)
    shifted: Array = np.interp(rows + samples, rows, values)
    return shifted
