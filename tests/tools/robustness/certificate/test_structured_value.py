"""Structured singular values of three channels against bounds, closed forms and SLICOT's routine."""

import ctrlsys
import numpy as np
import pytest

from cranectl.tools.robustness.certificate.structured import structured_values

BLOCKS, COMPLEX = np.ones(3, dtype=np.int32), np.full(3, 2, dtype=np.int32)


def random_matrices(seed: int, k: int, spread: float = 0.0) -> np.ndarray:
    """Entries of sizes that differ by up to ten to the `spread` either way."""
    rng = np.random.default_rng(seed)
    matrices = rng.normal(size=(k, 3, 3)) + 1j * rng.normal(size=(k, 3, 3))
    return matrices * 10.0 ** rng.uniform(-spread, spread, size=(k, 3, 3))


@pytest.mark.parametrize("spread", [0.0, 2.0])
def test_between_spectral_radius_and_norm_and_attained_by_the_scaling(spread: float) -> None:
    matrices = random_matrices(3, 400, spread)
    bounds, scalings = structured_values(matrices)
    assert (bounds >= np.abs(np.linalg.eigvals(matrices)).max(axis=1) * (1 - 1e-6)).all()
    assert (bounds <= np.linalg.norm(matrices, 2, axis=(1, 2)) * (1 + 1e-4)).all()
    scaled = scalings[:, :, None] * matrices / scalings[:, None, :]
    assert bounds == pytest.approx(np.linalg.norm(scaled, 2, axis=(1, 2)), rel=1e-9)


@pytest.mark.parametrize("spread", [0.0, 2.0])
def test_as_slicot_finds_them(spread: float) -> None:
    matrices = random_matrices(3, 50, spread)
    expected = [ctrlsys.ab13md(np.asfortranarray(matrix), BLOCKS, COMPLEX)[0] for matrix in matrices]
    assert structured_values(matrices)[0] == pytest.approx(np.array(expected), rel=3e-4)


def test_closed_forms() -> None:
    """The largest entry of a diagonal matrix; independent factors cannot use what is off it in a triangle."""
    diagonal = np.diag([1.0, -3.0j, 2.0])
    triangular = np.triu(np.full((3, 3), 5.0), 1) + np.eye(3)
    pair = np.array([[0.0, 8.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found, _ = structured_values(np.stack([diagonal, triangular, pair]).astype(complex))
    assert found[0] == pytest.approx(3.0, rel=1e-4)
    assert 1.0 <= found[1] < 1.01
    assert found[2] == pytest.approx(2.0, rel=1e-4)
    assert structured_values(np.zeros((1, 3, 3), dtype=complex))[0][0] < 1e-200
