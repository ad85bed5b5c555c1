"""Begin a run that a program steps, and check what the program gives: state, seed, target, commands."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cranectl.plants import FORCE, Plant
from cranectl.scenario import Scenario
from cranectl.signals import SignalGroup, State
from cranectl.simulate.loop import Loop
from cranectl.simulate.plan import Plan, check_start
from cranectl.simulate.prepared import PreparedController
from cranectl.support import Array, InputError

DRAWN_MARGIN = 0.1  # share of each range of the workspace, at both ends, where no drawn start lies


def begin(
    plant: Plant,
    plan: Plan,
    state: Sequence[float] | Array | None = None,
    seed: int | None = None,
    *,
    target: Sequence[float] | Array | None = None,
    records: tuple[Array, Array] | None = None,
) -> Loop:
    """Put a plant at the start of a run that repeats its command: row 0 of `inputs.controller.reference`.

    `records` are as in `Loop`. `state`, `seed` and `target` are as in
    `OpenRun.reset`.
    """
    scenario = plan.scenario
    if target is not None:
        point = checked_numbers("target", target, 3)
        plan = replace(plan, reference=rest_at(scenario, point))
        rest = scenario.reference.model_copy(update={"start": tuple(point.tolist()), "segments": ()})
        scenario = scenario.model_copy(update={"reference": rest})
    if seed is not None:
        InputError.check_whole(
            "seed", seed, 0, 2**63 - 1, "a whole number, from which noise and starts are drawn"
        )
        draw = np.random.default_rng(seed)
        # Both seeds are drawn in any case, so that the start below does not depend on the effects.
        scenario = _with_seeds(scenario, *draw.integers(2**32, size=2).tolist())
        if state is None:
            state = np.zeros(len(SignalGroup.STATE))
            low, high = scenario.reach.T
            margin = DRAWN_MARGIN * (high - low)
            State(state).axes[:] = draw.uniform(low + margin, high - margin)
        if scenario.effects.wind:
            air = scenario.air_velocity(len(plan.wind))
            plan = replace(plan, wind=np.hstack([air, plan.wind[:, FORCE:]]))
    if state is not None:
        start = checked_numbers("state", state, len(SignalGroup.STATE))
        check_start(scenario, start, remedy="give a state inside it")
        plan = replace(plan, initial_state=start)
    plan = replace(plan, scenario=scenario)
    controller = PreparedController.repeating(plan, plant.drive, np.zeros((1, 3)), "commands")
    loop = Loop(plan, plant, controller, endless=True, records=records)
    loop.inputs.controller.measured[: len(SignalGroup.STATE)] = np.nan
    return loop


def rest_at(scenario: Scenario, target: Array) -> Array:
    """Return the reference (1, 15) that rests at `target` (3,); raise InputError if the load cannot."""
    reference = np.zeros((1, len(SignalGroup.REFERENCE)))
    reference[0, :3] = target
    hanging = np.zeros(len(SignalGroup.STATE))
    State(hanging).axes[:] = target * (1.0, 1.0, -1.0)  # the rope hangs down and is -z long
    remedy = "give a target below the workspace of bridge and trolley, within reach of the rope"
    check_start(scenario, hanging, remedy=remedy, what="the target is")
    return reference


def _with_seeds(scenario: Scenario, sensing: int, wind: int) -> Scenario:
    """Return the scenario with these seeds of noise and gusts, where it has them."""
    seeds = {"sensing": sensing, "wind": wind}
    effects = {
        name: part.model_copy(update={"seed": seed})
        for name, seed in seeds.items()
        if (part := getattr(scenario.effects, name)) is not None
    }
    return scenario.model_copy(update={"effects": scenario.effects.model_copy(update=effects)})


def checked_numbers(what: str, values: Sequence[float] | Array, *shape: int) -> Array:
    """Return finite numbers of this shape; raise InputError for anything else."""
    try:
        numbers = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):  # the last: whole numbers too large for a float
        numbers = np.zeros(0)
    bad = np.argwhere(~np.isfinite(numbers))
    if numbers.shape != shape or len(bad):
        where = f", with {numbers[tuple(bad[0])]} at {bad[0].tolist()}" if len(bad) else ""
        raise InputError(
            f"{what} = {InputError.shown(values)}, of shape {numbers.shape}{where}",
            allowed=f"finite numbers in the shape {shape}",
            remedy=f"give {' times '.join(map(str, shape))} numbers",
        )
    return numbers
