"""What makes triangles a solid: every edge shared by two of them in opposite directions, and a positive volume."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def _welded(positions: NDArray[Any], indices: NDArray[Any]) -> NDArray[np.int64]:
    """(T, 3) indices after vertices at bit-equal positions became one; triangles without area in it are left out."""
    exact = np.ascontiguousarray(positions, np.float32) + np.float32(0)  # −0 and 0 are one place
    _, number = np.unique(exact.view(np.dtype((np.void, 12))).ravel(), return_inverse=True)
    corners = number.ravel()[indices].astype(np.int64)
    distinct = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return np.asarray(corners[distinct])


def open_edges(positions: NDArray[Any], indices: NDArray[Any]) -> int:
    """How many directed edges have no partner in the opposite direction; 0 for closed, consistently wound surfaces.

    Args:
        positions: (V, 3) positions; equal ones count as one vertex.
        indices: (T, 3) triangles.
    """
    corners = _welded(positions, indices)
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, edge = np.unique(low * (int(corners.max()) + 1) + high, return_inverse=True)
    balance = np.bincount(edge.ravel(), np.where(start < end, 1, -1))
    return int(np.abs(balance).sum())


def manifold(positions: NDArray[Any], indices: NDArray[Any]) -> bool:
    """Whether exactly two triangles meet on every edge, once each way, and no triangle is without an edge's length."""
    corners = _welded(positions, indices)
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    directed = np.unique(start * (int(corners.max()) + 1) + end)
    return len(corners) == len(indices) and len(directed) == 3 * len(corners) and open_edges(positions, indices) == 0


def volume(positions: NDArray[Any], indices: NDArray[Any]) -> float:
    """Volume that a closed surface encloses, negative if it is wound inwards: Σ a·(b × c) / 6 (divergence theorem)."""
    a, b, c = (positions[indices[:, k]].astype(np.float64) for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def face_normals(positions: NDArray[Any], indices: NDArray[Any]) -> NDArray[np.float64]:
    """(T, 3) unit normals by winding; zero where a triangle has no area."""
    a, b, c = (positions[indices[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.maximum(length, 1e-30))
