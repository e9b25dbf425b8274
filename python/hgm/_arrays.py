"""Arrays looked over before they are handed on: what is refused is named with its rule and its remedy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import InputRefused


def _array(name: str, value: ArrayLike) -> NDArray[Any]:
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputRefused(f"{name}: rows of different lengths: give one array ({error})") from None
    if array.dtype == object:
        raise InputRefused(f"{name}: not numbers: give a numpy array")
    return array


def contiguous(name: str, array: NDArray[Any]) -> NDArray[Any]:
    """The array itself: it is handed over without a copy, and so must lie in one piece."""
    if not array.flags.c_contiguous:
        raise InputRefused(f"{name}: not contiguous: give numpy.ascontiguousarray({name})")
    return array


def points(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """(n, 3) positions in mm: float64, finite, in one piece. A list becomes such an array."""
    array = _array(name, value)
    if not isinstance(value, np.ndarray):
        array = np.ascontiguousarray(array, dtype=np.float64)
    if array.dtype != np.float64:
        raise InputRefused(f"{name}: dtype {array.dtype}: give float64, {name}.astype(numpy.float64)")
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputRefused(f"{name}: shape {array.shape}: give (n, 3), a row of x, y, z in mm for each")
    contiguous(name, array)
    finite = np.isfinite(array)
    if not finite.all():
        row = int(np.nonzero(~finite.all(axis=1))[0][0])
        raise InputRefused(f"{name}: row {row} (counted from 0) is not finite: take it away or repair it")
    return array


def _whole(name: str, array: NDArray[Any], dtype: type, rule: str) -> NDArray[Any]:
    """Whole numbers as `dtype`; without a copy where they are so already."""
    if not np.issubdtype(array.dtype, np.integer):
        raise InputRefused(f"{name}: dtype {array.dtype}: give {rule}, as whole numbers")
    limits = np.iinfo(dtype)
    if array.size and (int(array.min()) < limits.min or int(array.max()) > limits.max):
        raise InputRefused(f"{name}: numbers from {array.min()} to {array.max()}: give {rule}")
    contiguous(name, array)
    return array.astype(dtype, copy=False)


def cells(name: str, value: ArrayLike) -> NDArray[np.uint32]:
    """(m, 4) node numbers, counted from 0."""
    array = _array(name, value)
    if array.ndim != 2 or array.shape[1] != 4:
        raise InputRefused(f"{name}: shape {array.shape}: give (m, 4), the four nodes of each tetrahedron")
    return _whole(name, array, np.uint32, "node numbers counted from 0")


def labels(name: str, value: ArrayLike, count: int | None = None) -> NDArray[np.uint8]:
    """(m,) labels, 0 to 255."""
    array = _array(name, value)
    if array.ndim != 1 or (count is not None and len(array) != count):
        wanted = "(m,)" if count is None else f"({count},)"
        raise InputRefused(f"{name}: shape {array.shape}: give {wanted}, one label for each tetrahedron")
    return _whole(name, array, np.uint8, "labels from 0 to 255")


def label_map(name: str, value: ArrayLike) -> NDArray[np.uint8]:
    """(i, j, k) labels, 0 to 255, in any order of memory."""
    array = _array(name, value)
    if array.ndim != 3:
        raise InputRefused(f"{name}: shape {array.shape}: give (i, j, k), one label for each voxel")
    if np.issubdtype(array.dtype, np.floating) and array.size and np.array_equal(array, np.round(array)):
        array = array.astype(np.int64)
    elif array.dtype == bool:
        array = array.astype(np.uint8)
    return _whole(name, array.ravel(order="F"), np.uint8, "labels from 0 to 255").reshape(array.shape, order="F")


def affine(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """(4, 4) voxel indices to mm, RAS+."""
    array = _array(name, value)
    if array.shape != (4, 4):
        raise InputRefused(f"{name}: shape {array.shape}: give (4, 4), voxel indices to mm (RAS+)")
    if not (np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)):
        raise InputRefused(f"{name}: dtype {array.dtype}: give real numbers, voxel indices to mm (RAS+)")
    # A file keeps three rows: a transposed matrix would lose its translation without a word.
    last = [0, 0, 0, 1]
    if not np.allclose(array[3], last, rtol=0, atol=1e-9):
        remedy = f", or its transpose {name}.T" if np.allclose(array[:, 3], last, rtol=0, atol=1e-9) else ""
        raise InputRefused(f"{name}: last row {array[3].tolist()}: give a matrix whose last row is 0 0 0 1{remedy}")
    # What products and inverses of matrices leave in it is rounding.
    return np.vstack([np.asarray(array[:3], dtype=np.float64), np.asarray([last], dtype=np.float64)])


def sets(value: Any, count: int) -> tuple[dict[str, list[int]], dict[str, list[list[int]]]]:
    """Node sets and facet sets: node numbers, truth values for every node (also as 0 and 1, as hgm's files have them), or
    (k, 3) facets."""
    nodes: dict[str, list[int]] = {}
    facets: dict[str, list[list[int]]] = {}
    for key, members in dict(value or {}).items():
        name = f"sets[{key!r}]"
        array = _array(name, members)
        if array.size == 0 and array.ndim == 1:
            nodes[key] = []
        elif array.dtype == bool:
            if array.shape != (count,):
                raise InputRefused(f"{name}: shape {array.shape}: give ({count},), a truth value for every node")
            nodes[key] = np.nonzero(array)[0].tolist()
        elif array.ndim == 1:
            numbers = _whole(name, np.ascontiguousarray(array), np.uint32, "node numbers counted from 0")
            distinct, counts = np.unique(numbers, return_counts=True)
            if len(numbers) == count and distinct[-1] <= 1:
                # As many as nodes, and a tetrahedron has four: these are no node numbers.
                nodes[key] = np.nonzero(numbers)[0].tolist()
            elif len(distinct) < len(numbers):
                twice = int(distinct[counts > 1][0])
                raise InputRefused(
                    f"{name}: node {twice} is named more than once: give each node once, or ({count},) truth values"
                )
            else:
                nodes[key] = numbers.tolist()
        elif array.ndim == 2 and array.shape[1] == 3:
            facets[key] = _whole(name, np.ascontiguousarray(array), np.uint32, "node numbers counted from 0").tolist()
        else:
            raise InputRefused(
                f"{name}: shape {array.shape}: give (k,) node numbers, ({count},) truth values, or (k, 3) facets"
            )
    return nodes, facets
