"""Upper bound of the structured singular value for independent complex factors of each channel.

mu(M) is at most the norm of D M D^-1 for every positive diagonal D, and equal to the least of them for up to
three channels. That norm is convex in the logarithms of D (Sezginer, Overton, IEEE TAC 35 (1990) 1163), so
the ellipsoid method with deep cuts finds it, for all frequencies side by side (Bland, Goldfarb, Todd,
Operations Research 29 (1981) 1039). SLICOT's AB13MD does the same, but as translated in ctrlsys it never
returns from some matrices; one of them is in the tests.
"""

import numpy as np

from cranectl.analysis.certificate.systems import Array, Complex

RADIUS = 4.0  # of the logarithms searched, about the scaling that balances rows and columns
ENOUGH = 1e-4  # of the bound, by which it may exceed the least
ITERATIONS = 150
BALANCING = 10
FARTHEST = 7.0  # of the logarithms that balance: without a coupling to balance they would run away
TINY = 1e-300


def structured_values(matrices: Complex) -> tuple[Array, Array]:
    """Upper bounds (k,) of mu, matrices (k, m, m) with m > 1, and the scalings (k, m) that give them.

    The bound is the norm of D M D^-1 itself, so that it holds however well the scalings were found.
    """
    k, m, _ = matrices.shape
    place = _balanced(matrices)
    shape = np.broadcast_to(RADIUS**2 * np.eye(m - 1), (k, m - 1, m - 1)).copy()
    best_place, best = place.copy(), np.full(k, np.inf)
    active = np.arange(k)
    for _ in range(ITERATIONS):
        value, slope = _norm_and_slope(matrices[active], place[active])
        better = value < best[active]
        best[active[better]], best_place[active[better]] = value[better], place[active[better]]
        reach = np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", slope, shape[active], slope), 0.0))
        # No point of the ellipsoid is lower than this one by more than the reach.
        left = value - reach < best[active] * (1.0 - ENOUGH)
        active, value, slope, reach = active[left], value[left], slope[left], reach[left]
        if len(active) == 0:
            break
        depth = np.minimum((value - best[active]) / reach, 0.99)
        place[active, 1:], shape[active] = _cut(place[active, 1:], shape[active], slope, reach, depth)
    return np.maximum(best, TINY), np.exp(best_place)


def _norm_and_slope(matrices: Complex, place: Array) -> tuple[Array, Array]:
    """Norm of D M D^-1 (k,), log D = `place` (k, m), and its slope over all of them but the first."""
    scale = np.exp(place)
    u, s, vh = np.linalg.svd(scale[:, :, None] * matrices / scale[:, None, :])
    slope = s[:, :1] * (np.abs(u[:, :, 0]) ** 2 - np.abs(vh[:, 0, :]) ** 2)
    return s[:, 0], slope[:, 1:]


def _cut(centre: Array, shape: Array, slope: Array, reach: Array, depth: Array) -> tuple[Array, Array]:
    """The smallest ellipsoid about what is left of one beyond a cut across it at `depth` of its reach."""
    n = centre.shape[1]
    direction = np.einsum("kij,kj->ki", shape, slope) / reach[:, None]
    step = (1.0 + n * depth) / (n + 1.0)
    shrink = n * n * (1.0 - depth**2) / (n * n - 1.0)
    flatten = 2.0 * (1.0 + n * depth) / ((n + 1.0) * (1.0 + depth))
    outer = direction[:, :, None] * direction[:, None, :]
    return (
        centre - step[:, None] * direction,
        shrink[:, None, None] * (shape - flatten[:, None, None] * outer),
    )


def _balanced(matrices: Complex) -> Array:
    """Logarithms of scalings with which each row is about as large as its column; Osborne's iteration."""
    size = np.abs(matrices) ** 2
    k, m, _ = size.shape
    size[:, range(m), range(m)] = 0.0
    place = np.zeros((k, m))
    for _ in range(BALANCING):
        for i in range(m):
            weight = np.exp(2.0 * (place[:, i, None] - place))
            row = (size[:, i, :] * weight).sum(axis=1)
            column = (size[:, :, i] / weight).sum(axis=1)
            ratio = (column + TINY) / (row + TINY)
            place[:, i] += 0.25 * np.log(np.clip(ratio, 1e-4, 1e4))
    return np.clip(place - place[:, :1], -FARTHEST, FARTHEST)
