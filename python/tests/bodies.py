"""Bodies that a test can say everything about."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

#: A cube's six tetrahedra around its diagonal.
_SIX = [(0, *order, 7) for order in [(1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)]]

NEO_HOOKEAN = {"law": "neo-hookean", "shear_modulus_pa": 1000.0, "poisson_ratio": 0.45}


def bar(n: int = 3, size_mm: float = 30.0) -> tuple[NDArray[np.float64], NDArray[np.uint32], NDArray[np.uint8]]:
    """A cube of n^3 cubes of six tetrahedra each, its foot at z = 0."""
    axis = np.linspace(0.0, size_mm, n + 1)
    points = np.array([(x, y, z) for z, y, x in itertools.product(axis, axis, axis)])
    number = lambda i, j, k: i + (n + 1) * (j + (n + 1) * k)  # noqa: E731
    cells = []
    for k, j, i in itertools.product(range(n), repeat=3):
        corners = [number(i + a, j + b, k + c) for c, b, a in itertools.product((0, 1), repeat=3)]
        cells += [[corners[m] for m in six] for six in _SIX]
    tets = np.array(cells, dtype=np.uint32)
    x = points[tets]
    negative = np.einsum("ij,ij->i", x[:, 1] - x[:, 0], np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 0])) < 0
    tets[negative] = tets[negative][:, [0, 2, 1, 3]]
    return points, tets, np.full(len(tets), 2, dtype=np.uint8)


def scenario(gravity: float = -9.81, **solver: object) -> dict[str, object]:
    return {
        "fixed": ["base"],
        "materials": {"grey_matter": NEO_HOOKEAN},
        "loads": {"gravity_m_per_s2": [0.0, 0.0, gravity]},
        "solver": {"element": "tet4", "relative_residual": 1e-12, **solver},
    }
