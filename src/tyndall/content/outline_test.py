"""Adjacency: what is closed, what is an edge, and where a light is inside."""

from __future__ import annotations

import numpy as np
import props
import pytest

from tyndall.content.outline import NONE, SAME_WAY, Adjacency, welded
from tyndall.scene.model import Mesh

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint32)


def sums(adjacency: Adjacency, weights: np.ndarray) -> dict[tuple[int, int], int]:
    """By directed edge (lesser vertex first), what triangles of these weights sum up to along it."""
    found: dict[tuple[int, int], int] = {}
    for v0, v1, one, other in adjacency.edges.astype(np.int64):
        total = weights[one]
        if other != NONE:
            total += weights[other & ~SAME_WAY] * (1 if other & SAME_WAY else -1)
        key, sign = ((v0, v1), 1) if v0 < v1 else ((v1, v0), -1)
        found[key] = found.get(key, 0) + sign * total
    return {key: value for key, value in found.items() if value}


def expected(corners: np.ndarray, weights: np.ndarray) -> dict[tuple[int, int], int]:
    found: dict[tuple[int, int], int] = {}
    for triangle, weight in zip(corners, weights, strict=True):
        if len(set(triangle)) < 3:
            continue
        for a, b in ((0, 1), (1, 2), (2, 0)):
            v0, v1 = int(triangle[a]), int(triangle[b])
            key, sign = ((v0, v1), 1) if v0 < v1 else ((v1, v0), -1)
            found[key] = found.get(key, 0) + sign * int(weight)
    return {key: value for key, value in found.items() if value}


def test_a_tetrahedron_is_closed_and_each_edge_has_two_sides() -> None:
    found = Adjacency.of(Mesh(TETRAHEDRON, FACES))
    assert found.closed.all()
    assert len(found.edges) == 6
    assert not (found.edges[:, 3] & np.uint32(SAME_WAY)).any()
    assert (found.edges[:, 3] < 4).all()


def test_duplicated_vertices_are_one() -> None:
    split = Mesh(TETRAHEDRON[FACES.ravel()], np.arange(12, dtype=np.uint32).reshape(4, 3))
    found = Adjacency.of(split)
    assert found.closed.all()
    assert len(found.edges) == 6


def test_zero_has_no_sign_where_vertices_are_compared() -> None:
    assert welded(np.array([[0.0, 1, 2], [-0.0, 1, 2], [0, 1, 3]], np.float32)).tolist() == [0, 0, 2]


def test_without_a_face_it_is_open() -> None:
    found = Adjacency.of(Mesh(TETRAHEDRON, FACES[:3]))
    assert not found.closed.any()
    assert (found.edges[:, 3] == NONE).sum() == 3


def test_a_face_turned_round_makes_it_open() -> None:
    turned = FACES.copy()
    turned[0] = turned[0, ::-1]
    found = Adjacency.of(Mesh(TETRAHEDRON, turned))
    assert not found.closed.any()
    assert ((found.edges[:, 3] & np.uint32(SAME_WAY)) != 0).sum() == 3


def test_closed_and_open_parts_are_told_apart() -> None:
    positions = np.concatenate([TETRAHEDRON, TETRAHEDRON + 5])
    found = Adjacency.of(Mesh(positions, np.concatenate([FACES, FACES[:2] + 4])))
    assert found.closed.tolist() == [True] * 4 + [False] * 2
    assert len(set(found.part[:4])) == 1
    assert found.part[0] != found.part[4]


def test_triangles_without_area_change_nothing() -> None:
    """Two equal corners, as a collapsed cap of a sphere has them."""
    collapsed = np.concatenate([FACES, [[0, 0, 1], [2, 2, 2]]]).astype(np.uint32)
    found = Adjacency.of(Mesh(TETRAHEDRON, collapsed))
    assert len(found.edges) == 6
    assert found.closed.tolist() == [True] * 4 + [False] * 2


@pytest.mark.parametrize("seed", range(6))
def test_edges_sum_up_what_their_triangles_do(seed: int) -> None:
    """Whatever triangles meet at an edge, and whatever their weights: the sum along it is theirs."""
    rng = np.random.default_rng(seed)
    indices = rng.integers(0, 7, (40, 3)).astype(np.uint32)
    mesh = Mesh(rng.normal(size=(7, 3)).astype(np.float32), indices)
    weights = rng.integers(-1, 2, 40)
    assert sums(Adjacency.of(mesh), weights) == expected(indices, weights)


def test_a_bundled_solid_is_closed() -> None:
    """The fixture's box is made of quads that share no vertices."""
    assert Adjacency.of(props.box((0, 0, 0), (1, 2, 3)).mesh).closed.all()
