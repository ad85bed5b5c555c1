"""Predict a measured run: give its commands, or the motion of its pivot and rope, to a plant.

`commands` gives the measured commands to the plant's drives of the same kind, and holds each until the next.
`lines` does the same, and changes commands along lines: for slow logs, which miss most of them. `motion`
moves bridge, trolley and rope as measured, with ideal drives, so that only the swing of the load is
predicted. All start from the first measured state, or at rest.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.signal import savgol_filter

from cranectl.design import ControllerDesign
from cranectl.plants import PLANTS, Drive, PhysicsStep
from cranectl.scenario import NANOSECONDS, RigParameters, Scenario, longest_step, nanoseconds
from cranectl.signals import SignalGroup, State
from cranectl.simulate import Loop, Plan, PreparedController, Run, RunMemory
from cranectl.support import Array, InputError
from cranectl.tools.measured.assembly import RATE_ORDER, rate_samples
from cranectl.tools.measured.followed_motion import MEASURED_MOTION

# Steps of order 5 with four steps in the fastest time, the shortest lag of a drive for example, err by less
# than 1e-4 of the noise of the laboratory's encoders (tests/tools/measured/test_replay_steps.py).
LONGER_STEPS = 5.0  # times the step with which all plants agree to 1e-7
LINE_PARTS = (4, 5, 6, 8, 3, 2, 1)  # of a period; the first number whose parts have long steps is taken
MORE_STEPS = 4  # times the physics steps of a period, which all of its parts may take

Replay = Literal["commands", "lines", "motion"]
REPEATED: Mapping[Replay, str] = {
    "commands": "commands repeated",
    "lines": "commands repeated along lines",
    "motion": "motion repeated",
}


def default_replay(run: Run) -> Replay:
    """Return how a measured run is replayed if nobody chooses: by its commands, if it has them."""
    return "commands" if run.has("command") else "motion"


def first_samples(run: Run, samples: int) -> Run:
    """Return the beginning of a measured run, as views of its samples."""
    part = slice(samples)
    return replace(run, time_ns=run.time_ns[part], table=run.table[part], reference=run.reference[part])


def simulate_replay(
    run: Run,
    plant: str,
    replay: Replay,
    *,
    scenario: Scenario | None = None,
    commands: Array | None = None,
    initial: Array | None = None,
) -> Run:
    """Simulate what drives a measured run; the result has the same times, or fewer.

    `scenario` is the crane in place of that of the run. `commands` (N, 3), or positions, rates and
    accelerations of the axes (N, 9), replace the measured ones, and `initial` (10,) the first measured
    state.
    """
    given = scenario = scenario or run.scenario
    drive: Drive = "ideal" if replay == "motion" else run.drive
    if commands is None:
        commands = measured_motion(run) if replay == "motion" else run.commands
    state = run.state.values
    start = state[0].copy() if initial is None else initial
    time_ns, parts = run.time_ns, 1
    if replay == "lines":
        parts, scenario = _parted(scenario)
        commands = _middles(commands, parts)
        state = np.repeat(state, parts, axis=0)[: len(commands)]
        time_ns = scenario.period_ns * np.arange(len(commands))
    samples = len(time_ns)
    RunMemory(scenario).check_runs(ControllerDesign(""), drive)
    plan = Plan(
        time_ns=time_ns,
        reference=np.zeros((samples, len(SignalGroup.REFERENCE))),
        reference_state=state,
        gravity=scenario.rig.gravity,
        scenario=scenario,
        initial_state=start,
        disturbance=np.zeros((samples, 2)),
        wind=np.zeros((samples, 6)),
    )
    crane = PLANTS.make(plant, scenario, drive)
    repeated = (commands, MEASURED_MOTION) if replay == "motion" else (commands,)
    simulated = Loop(plan, crane, PreparedController.repeating(plan, drive, *repeated)).run()
    if parts == 1:
        return simulated
    table, reference = (rows[::parts] for rows in (simulated.table, simulated.reference))
    times = run.time_ns[: len(table)]
    end_ns = int(times[-1]) if len(times) else simulated.end_ns  # it may end before its first sample
    return replace(simulated, scenario=given, time_ns=times, end_ns=end_ns, table=table, reference=reference)


def _parted(scenario: Scenario) -> tuple[int, Scenario]:
    """Return into how many parts to cut the control period, and the scenario with such a period.

    Periods and steps are whole nanoseconds, so parts of some periods have very short steps only.
    """
    control = scenario.control
    whole, usual = nanoseconds(control.period), control.physics_step or control.period
    for parts in LINE_PARTS:
        period = whole // parts / NANOSECONDS
        step = longest_step(period, min(usual, period))
        if whole % parts == 0 and parts * period / step <= MORE_STEPS * max(control.period / usual, parts):
            break
    control = control.model_copy(
        update={"period": period, "physics_step": step if control.physics_step else None}
    )
    return parts, scenario.model_copy(update={"control": control})


def _middles(commands: Array, parts: int) -> Array:
    """Return the commands in the middle of each part of a line, which stand for it, and the last one."""
    shares = (np.arange(parts) + 0.5) / parts
    between = commands[:-1, None] + shares[:, None] * np.diff(commands, axis=0)[:, None]
    return np.vstack([between.reshape(-1, commands.shape[1]), commands[-1:]])


def with_longer_steps(scenario: Scenario, drive: Drive) -> Scenario:
    """Return the scenario with physics steps that are exact enough to compare with encoders.

    They suit the plant `elastic`, whose steps have order 5 and end where a joint sticks or slides. Ropes,
    loads and frames that vibrate keep the steps of the scenario.
    """
    effects, control = scenario.effects, scenario.control
    if effects.rope or effects.body or effects.frame:
        return scenario
    longest = LONGER_STEPS * PhysicsStep(scenario, drive).longest
    step = max(longest_step(control.period, min(longest, control.period)), control.physics_step or 0.0)
    return scenario.model_copy(update={"control": control.model_copy(update={"physics_step": step})})


def measured_motion(run: Run) -> Array:
    """Return smoothed positions, rates and accelerations of bridge, trolley and rope, shape (N, 9)."""
    positions = run.state.axes
    period = run.scenario.period_ns / NANOSECONDS
    samples = rate_samples(period)
    if len(positions) < samples:
        raise InputError(
            f"the measured run has {len(positions)} samples",
            allowed=f"at least {samples}",
            remedy="import a longer part",
        )
    smooth = [
        savgol_filter(positions, samples, polyorder=RATE_ORDER, deriv=order, delta=period, axis=0)
        for order in range(3)
    ]
    return np.hstack(smooth)


def positions_before(state: Array, late: float, period: float) -> Array:
    """Return the positions (N, 5) of states (N, 10) `late` seconds before each, at most a period.

    Between two samples they are cubics with the positions and rates of both (Hermite). All are wanted at
    one share of their span, for which SciPy's splines take 27 times as long.
    """
    position, rate, share = State(state).joints, State(state).joint_rates, 1.0 - late / period
    rising = share * share * (3.0 - 2.0 * share)
    first = period * share * (1.0 - share) ** 2
    second = period * share * share * (share - 1.0)
    between: Array = np.vstack([position[:1] - late * rate[:1], np.empty_like(position[1:])])
    between[1:] = position[:-1] + rising * (position[1:] - position[:-1])
    between[1:] += first * rate[:-1] + second * rate[1:]
    return between


def crane_scenario(scenario: Scenario, rig: RigParameters, replay: Replay) -> Scenario:
    """Return the scenario of a measured run for a crane with friction; moved axes feel none."""
    none = {"viscous": (0.0, 0.0, 0.0)} | ({"coulomb": (0.0, 0.0, 0.0)} if replay == "motion" else {})
    effects = scenario.effects.model_copy(update={"friction": rig.effects.friction.model_copy(update=none)})
    return scenario.model_copy(update={"rig": rig, "effects": effects})
