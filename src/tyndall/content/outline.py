"""Adjacency of triangles, from which the outline that a light sees is found on the device.

An edge lies on the outline where the triangles on its two sides do not both face the light. So each edge knows its two
triangles. What real meshes look like is taken care of here, once for each mesh:

- **Vertices of equal position are one** (exporters duplicate them along seams of texture and normals).
- **An edge of more than two triangles** is written as several edges of two, a side each where possible; one of a
  single triangle as an edge with an empty side. What techniques make of edges is a sum over triangles (Kim et al.
  2008, *Shadow volumes for non-manifold surfaces*), and a sum may be split.
- **Closed parts are told from open ones.** A part, triangles connected by edges, is closed if each of its edges has two
  triangles that run along it in opposite directions. Of a closed part the triangles that face the light are enough; an
  open one casts with both sides, and each of its triangles must count. So does a closed one that is wound inside out,
  as rooms are that are seen from within only: the triangles that face the light are its far ones.
- **Triangles with two equal corners** have no area and no say. Those with three corners on a line keep their place
  between their neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu
from tyndall.gpu.resources import Bound, Buffer, Parts, Resource
from tyndall.scene.model import DirectionalLight, Light, Mesh, box_corners

_PART = "package::content::outline::OutlinePart"
NONE = 0x7FFFFFFF  # in place of a triangle, as outline.wesl has it
_TOUCHING = 4e-6  # of the coordinates' size: a light that is so near to a triangle is in it; see silhouettes.wesl
SAME_WAY = 1 << 31  # the second triangle runs along the edge as the first one does


@dataclass(frozen=True, eq=False)
class Adjacency:
    """The edges of a mesh.

    Attributes:
        edges: (E, 4) uint32: two vertices, the triangle that runs from the first to the second, and another or
            :data:`NONE`, which runs back unless :data:`SAME_WAY` is set.
        closed: (T,) whether a triangle is of a closed part that is wound outwards.
        part: (T,) int64, a number for each connected part.
    """

    edges: NDArray[np.uint32]
    closed: NDArray[np.bool_]
    part: NDArray[np.int64]

    @classmethod
    def of(cls, mesh: Mesh) -> Adjacency:
        """Find the edges of a mesh; a second or two for a million triangles."""
        corners = welded(mesh.positions)[mesh.indices].astype(np.int64)
        count = len(corners)
        a, b, c = corners.T
        whole = np.flatnonzero((a != b) & (b != c) & (c != a))
        start = np.concatenate([corners[whole, i] for i in (0, 1, 2)])
        stop = np.concatenate([corners[whole, i] for i in (1, 2, 0)])
        triangle = np.tile(whole, 3)
        back = start > stop
        key = np.minimum(start, stop) * (int(corners.max()) + 1) + np.maximum(start, stop)

        # The half edges of an edge stand together, one forward and one back in turn as long as there are both; then
        # each two that follow each other are an edge.
        order = np.lexsort((back, key))
        edge, turned = _numbered(key[order]), back[order]
        rank = _places(2 * edge + turned)
        order = order[np.lexsort((turned, rank, edge))]
        edge, turned = edge[np.argsort(edge, kind="stable")], back[order]
        place = _places(edge)
        heads = np.flatnonzero(place % 2 == 0)
        followed = np.r_[place[1:] % 2 == 1, False][heads] if len(heads) else np.zeros(0, bool)
        tails = np.where(followed, heads + 1, heads)
        ahead, behind = order[heads], order[tails]
        second = np.where(followed, triangle[behind], NONE)
        second = np.where(followed & (back[ahead] == back[behind]), second | SAME_WAY, second)
        edges = np.stack([start[ahead], stop[ahead], triangle[ahead], second], axis=1).astype(np.uint32)

        part = _connected(count, triangle[ahead[followed]], triangle[behind[followed]])
        sizes, turns = np.bincount(edge), np.bincount(edge, weights=turned)
        sound = (sizes == 2) & (turns == 1)
        open_parts = np.zeros(count, bool)
        open_parts[part[triangle[order[~sound[edge]]]]] = True
        closed = ~open_parts[part]
        closed[np.setdiff1d(np.arange(count), whole)] = False
        closed &= _volumes(mesh, part)[part] >= 0
        return cls(edges, closed, part)


def _volumes(mesh: Mesh, part: NDArray[np.int64]) -> NDArray[np.float64]:
    """By a part's number, six times the volume that it encloses; below 0 where it is wound inside out."""
    middle = 0.5 * (mesh.bounds[0].astype(np.float64) + mesh.bounds[1])
    a, b, c = (mesh.positions[mesh.indices[:, i]] - middle for i in range(3))
    return np.bincount(part, weights=np.einsum("ij,ij->i", a, np.cross(b, c)))


def welded(positions: NDArray[np.float32]) -> NDArray[np.int64]:
    """(V,) by vertex, the first vertex of an equal position."""
    bits = (positions + np.float32(0)).view(np.uint32)  # −0 is 0
    order = np.lexsort(bits.T)
    same = (bits[order[1:]] == bits[order[:-1]]).all(axis=1)
    group = np.concatenate([[0], np.cumsum(~same)])
    first = np.full(int(group[-1]) + 1, len(bits), np.int64)
    np.minimum.at(first, group, order)
    found = np.empty(len(bits), np.int64)
    found[order] = first[group]
    return found


def _numbered(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sorted values as 0, 1, 2 …, equal ones alike."""
    return np.concatenate([[0], np.cumsum(values[1:] != values[:-1])]) if len(values) else values


def _places(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """The place of each element among the equal ones that it stands with."""
    number = _numbered(values)
    first = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1]) if len(values) else values
    return np.arange(len(values)) - first[number]


def _connected(count: int, a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
    """(count,) the least number of those that each is connected with by pairs (a, b)."""
    label = np.arange(count)
    while True:
        one, other = label[a], label[b]
        if (one == other).all():
            return label
        np.minimum.at(label, np.maximum(one, other), np.minimum(one, other))
        while (shorter := label[label]).tobytes() != label.tobytes():
            label = shorter


def _any_touches(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], near: float) -> bool:
    """Whether the origin lies in one of the triangles of corners (T, 3), to a distance."""
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    touched = (np.abs(np.einsum("ij,ij->i", normal, a)) <= near * size) & (size > 0)
    for start, stop in ((a, b), (b, c), (c, a)):
        along = np.einsum("ij,ij->i", np.cross(start, stop), normal)
        touched &= along >= -near * size * np.linalg.norm(stop - start, axis=1)
    return bool(touched.any())


@dataclass(frozen=True)
class Placed:
    """A mesh where it stands: where its triangles and vertices begin in the streams, its row of ``instances``, and its
    transform (4×4), for vertices as the mesh has them.
    """

    mesh: Mesh
    first_index: int
    first_vertex: int
    instance: int
    mirrored: bool
    transform: NDArray[np.float64]


class Outline:
    """The adjacency of placed meshes on the device.

    Attributes:
        triangles, edges: how many there are, counted once for each placement.
        most_records: upper bound of the pieces that an outline may have; an edge of an open part may count twice.
        parts: how many placements.
        closed: whether all parts of all meshes are.
    """

    def __init__(
        self, gpu: Gpu, placed: Sequence[Placed], streams: tuple[Buffer, Buffer, Bound], *, owner: str
    ) -> None:
        """``streams`` are positions, indices and instances."""
        self._placed = tuple(placed)
        found = {key: Adjacency.of(mesh) for key, mesh in {id(p.mesh): p.mesh for p in placed}.items()}
        self._found = found
        bases: dict[int, int] = {}
        stored = 0
        for key, adjacency in found.items():
            bases[key] = stored
            stored += len(adjacency.edges)
        rows = np.zeros(len(placed) + 1, gpu.dtype(_PART))
        self.triangles = self.edges = self.most_records = 0
        last = max(p.first_index // 3 + p.mesh.triangle_count for p in placed)
        closed = np.zeros(-(-last // 32) * 32, np.uint8)
        for row, p in zip(rows, placed, strict=False):
            adjacency = found[id(p.mesh)]
            row["first_triangle"], row["first_edge"] = self.triangles, self.edges
            row["triangle_base"], row["edge_base"] = p.first_index // 3, bases[id(p.mesh)]
            row["vertex_base"], row["instance"], row["mirrored"] = p.first_vertex, p.instance, p.mirrored
            closed[p.first_index // 3 :][: p.mesh.triangle_count] = adjacency.closed
            self.triangles += p.mesh.triangle_count
            self.edges += len(adjacency.edges)
            self.most_records += len(adjacency.edges) * (1 if adjacency.closed.all() else 2)
        rows[-1]["first_triangle"], rows[-1]["first_edge"] = self.triangles, self.edges
        self.parts = len(placed)
        self.closed = all(adjacency.closed.all() for adjacency in found.values())
        edges = np.concatenate([a.edges for a in found.values()])
        bits = np.packbits(closed.reshape(-1, 32), axis=1, bitorder="little").view("<u4").ravel()
        positions, indices, instances = streams
        self._buffers = [
            gpu.buffer("outline.parts", rows, owner=owner, element=_PART),
            gpu.buffer("outline.edges", edges, owner=owner, element="vec4u"),
            gpu.buffer("outline.closed", bits, owner=owner),
        ]
        parts, all_edges, all_closed = self._buffers
        self.bindings: dict[str, Bound | Parts] = {
            "outline_parts": parts.read(),
            "outline_edges": all_edges.split(),
            "outline_closed": all_closed.read(),
            "outline_positions": positions.split("f32"),
            "outline_indices": indices.split("u32"),
            "outline_instances": instances,
        }

    def is_inside(self, light: Light) -> list[bool]:
        """For each placement, whether a light is inside one of its closed parts or in its surface: then what faces away
        from it casts.

        The sum of the solid angles of a part's triangles, as the light sees them, is 4π inside and 0 outside (van
        Oosterom and Strackee 1983). In the surface it is anything between.
        """
        if isinstance(light, DirectionalLight):
            return [False] * self.parts
        return [self._surrounds(p, np.asarray(light.position, np.float64)) for p in self._placed]

    def _surrounds(self, p: Placed, point: NDArray[np.float64]) -> bool:
        adjacency = self._found[id(p.mesh)]
        low, high = (corner.astype(np.float64) for corner in p.mesh.bounds)
        corners = box_corners(low, high) @ p.transform[:3, :3].T + p.transform[:3, 3]
        near = _TOUCHING * max(np.linalg.norm(point), np.linalg.norm(corners, axis=1).max())
        beside = (point < corners.min(axis=0) - near).any() or (point > corners.max(axis=0) + near).any()
        if beside or not adjacency.closed.any():
            return False
        world = p.mesh.positions.astype(np.float64) @ p.transform[:3, :3].T + p.transform[:3, 3] - point
        a, b, c = np.moveaxis(world[p.mesh.indices[adjacency.closed]], 1, 0)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
        angle = 2 * np.arctan2(volume, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)
        turns = np.bincount(adjacency.part[adjacency.closed], weights=angle) / (4 * np.pi)
        return bool((np.abs(turns) > 0.25).any()) or _any_touches(a, b, c, near)

    def resources(self) -> list[Resource]:
        """What it holds on the device."""
        return list(self._buffers)

    def close(self) -> None:
        """Free all device memory."""
        for buffer in self._buffers:
            buffer.destroy()
