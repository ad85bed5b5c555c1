"""Segments that are to be planned, planned: in minimum time, or as short as the law of degree 9 can be."""

import numpy as np

from cranectl.reference.planning.geometry import Circular, Geometry, Straight
from cranectl.reference.planning.limits import Limits, limits_of
from cranectl.reference.planning.minimum_time import ASIDE, SPANS, Task, along_path, minimum_time
from cranectl.reference.planning.series import Series
from cranectl.reference.planning.shortest import shortest
from cranectl.reference.time_laws import time_law
from cranectl.scenario import Line, Scenario
from cranectl.scenario.segments import MINIMUM_TIME, Arc, Move, Spline, SplineLaw
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError


def planned_along(segment: Line | Arc, start: Array, scenario: Scenario, where: str) -> Line | Arc:
    """A segment on a given path with its duration, and its law if that is to be found."""
    limits = limits_of(scenario)
    geometry: Geometry
    if isinstance(segment, Line):
        geometry = Straight(start, np.array(segment.to))
    else:
        geometry = Circular(start, np.array(segment.centre), segment.angle)
    duration = _shortest(geometry, limits, where)
    if segment.time_law != MINIMUM_TIME:
        return segment.model_copy(update={"duration": duration})
    found = minimum_time(along_path(geometry, limits, duration))
    if found is None or found.duration > duration:
        return segment.model_copy(update={"duration": duration, "time_law": "degree-9"})
    law = SplineLaw(coefficients=tuple(np.clip(found.coefficients[:, 0], 0.0, 1.0).tolist()))
    return segment.model_copy(update={"duration": found.duration, "time_law": law})


def planned_move(segment: Move, start: Array, scenario: Scenario, where: str) -> Spline:
    """A free motion as the spline that was found."""
    limits = limits_of(scenario)
    end = np.array(segment.to)
    duration = _shortest(Straight(start, end), limits, where)
    task = _free(start, end, limits, duration)
    found = minimum_time(task)
    if found is None or found.duration > duration:
        raise NotImplementedError
    breaks = np.linspace(0.0, found.duration, task.spans + 1)
    return Spline(
        kind="spline",
        degree=7,
        breaks=tuple(breaks.tolist()),
        coefficients=tuple(map(tuple, found.coefficients.tolist())),
        made_from=segment.model_dump(mode="json", exclude_defaults=True),
    )


def _free(start: Array, end: Array, limits: Limits, duration: float) -> Task:
    parts = np.linspace(0.0, 1.0, 401)
    way = end - start
    distance = float(np.linalg.norm(way))
    aside = np.array([-way[1], way[0], 0.0])
    aside = aside / np.linalg.norm(aside) if aside.any() else np.array([1.0, 0.0, 0.0])
    bump = ASIDE * distance * (aside + np.array([0.0, 0.0, 1.0]))
    guess = start + time_law("degree-9", parts)[0][:, None] * way + np.sin(np.pi * parts)[:, None] ** 4 * bump
    return Task(start, end, _itself, limits, guess, duration, SPANS)


def _itself(coordinates: list[Series]) -> list[Series]:
    return coordinates


def _shortest(geometry: Geometry, limits: Limits, where: str) -> float:
    found = shortest(geometry, limits)
    if isinstance(found, float):
        return found
    worst = max(found, key=lambda name: found[name])
    raise InputError(f"{where} cannot be driven at any speed: {worst} is off by {found[worst]:.3g}")
