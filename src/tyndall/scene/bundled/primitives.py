"""Triangle geometry from formulas: the parts that the bundled scenes are assembled from.

Every builder returns a :class:`Geometry` in metres with counter-clockwise outward winding. Solids are closed: where a
crease or a texture seam needs two normals or two texture coordinates at one point, vertices are duplicated at
bit-equal positions, so that welding by position gives back a surface without boundary. Shadow maps that draw back
faces only depend on that. Texture coordinates are in metres unless a builder says otherwise.

Implicit surfaces are meshed by naive surface nets (Gibson 1998, "Constrained elastic surface nets"): one vertex in each
cell that the surface crosses, one quadrilateral across each grid edge that it crosses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.scene.model import Material, Mesh, vertex_normals

Floats = NDArray[np.floating[Any]]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Geometry:
    """Indexed triangles without a material.

    Attributes:
        positions: (V, 3) float32, metres.
        normals: (V, 3) float32, unit length.
        uvs: (V, 2) float32.
        indices: (T, 3) uint32, counter-clockwise seen from outside.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    indices: NDArray[np.uint32]

    @property
    def triangle_count(self) -> int:
        return len(self.indices)

    def mesh(self, material: Material, name: str) -> Mesh:
        return Mesh(self.positions, self.indices, self.normals, self.uvs, material, name)

    def placed(self, matrix: Matrix) -> Geometry:
        """A copy moved by an affine (4, 4) matrix; a mirroring one keeps the winding outward."""
        linear = matrix[:3, :3]
        positions = (self.positions @ linear.T + matrix[:3, 3]).astype(np.float32)
        normals = _unit(self.normals @ np.linalg.inv(linear))
        indices = self.indices if np.linalg.det(linear) > 0 else np.ascontiguousarray(self.indices[:, ::-1])
        return Geometry(positions, normals, self.uvs, indices)

    def at(self, x: float, y: float, z: float, turn: float = 0.0) -> Geometry:
        """A copy turned about +Y by ``turn`` radians, then moved."""
        return self.placed(translation(x, y, z) @ rotation("y", turn))

    def retextured(self, offset: ArrayLike = (0, 0), scale: ArrayLike = (1, 1)) -> Geometry:
        """A copy with uv' = uv · scale + offset."""
        uvs = self.uvs * np.asarray(scale, np.float32) + np.asarray(offset, np.float32)
        return Geometry(self.positions, self.normals, uvs, self.indices)


def _unit(vectors: Floats) -> NDArray[np.float32]:
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    unit: NDArray[np.float32] = (vectors / np.maximum(length, 1e-20)).astype(np.float32)
    return unit


# --- transforms ---------------------------------------------------------------------------------------------------


def translation(x: float, y: float, z: float) -> Matrix:
    """(4, 4) matrix that moves by (x, y, z)."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scaling(x: float, y: float, z: float) -> Matrix:
    """(4, 4) matrix that scales the axes."""
    return np.diag([x, y, z, 1.0])


def rotation(axis: str, angle: float) -> Matrix:
    """(4, 4) right-handed rotation about the ``"x"``, ``"y"`` or ``"z"`` axis by ``angle`` radians."""
    matrix = np.eye(4)
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix[[first, second], [first, second]] = math.cos(angle)
    matrix[first, second], matrix[second, first] = -math.sin(angle), math.sin(angle)
    return matrix


def placements(positions: Floats, turns: Floats, scales: Floats | float = 1.0, tilts: Floats | float = 0.0) -> Matrix:
    """(N, 4, 4) matrices: scale, tilt about X, turn about Y, move to ``positions`` (N, 3)."""
    count = len(positions)
    scale = np.broadcast_to(scales, count)
    cy, sy = np.cos(turns), np.sin(turns)
    cx, sx = np.cos(np.broadcast_to(tilts, count)), np.sin(np.broadcast_to(tilts, count))
    matrices = np.zeros((count, 4, 4))
    matrices[:, 0, :3] = np.stack([cy, sy * sx, sy * cx], 1) * scale[:, None]
    matrices[:, 1, :3] = np.stack([np.zeros(count), cx, -sx], 1) * scale[:, None]
    matrices[:, 2, :3] = np.stack([-sy, cy * sx, cy * cx], 1) * scale[:, None]
    matrices[:, :3, 3] = positions
    matrices[:, 3, 3] = 1
    return matrices


# --- combination --------------------------------------------------------------------------------------------------


def merge(parts: Iterable[Geometry]) -> Geometry:
    """One geometry from several, in order."""
    parts = list(parts)
    starts = np.cumsum([0, *(len(p.positions) for p in parts[:-1])], dtype=np.uint32)
    return Geometry(
        np.concatenate([p.positions for p in parts]),
        np.concatenate([p.normals for p in parts]),
        np.concatenate([p.uvs for p in parts]),
        np.concatenate([p.indices + start for p, start in zip(parts, starts, strict=True)]),
    )


def repeat(part: Geometry, matrices: Matrix, uv_offsets: Floats | None = None) -> Geometry:
    """Copies of a geometry at (N, 4, 4) similarities, merged; ``uv_offsets`` (N, 2) vary their texture."""
    count, vertices = len(matrices), len(part.positions)
    linear = matrices[:, :3, :3].astype(np.float32)
    positions = part.positions @ linear.transpose(0, 2, 1)
    positions += matrices[:, None, :3, 3].astype(np.float32)
    size = np.cbrt(np.linalg.det(matrices[:, :3, :3])).astype(np.float32)
    normals = part.normals @ (linear / size[:, None, None]).transpose(0, 2, 1)
    uvs = np.broadcast_to(part.uvs, (count, vertices, 2))
    if uv_offsets is not None:
        uvs = uvs + np.asarray(uv_offsets, np.float32)[:, None]
    starts = np.arange(count, dtype=np.uint32) * np.uint32(vertices)
    indices = part.indices + starts[:, None, None]
    return Geometry(
        positions.reshape(-1, 3),
        _unit(normals.reshape(-1, 3)),
        np.ascontiguousarray(uvs, np.float32).reshape(-1, 2),
        indices.reshape(-1, 3),
    )


def refine(part: Geometry, triangles: int, project: Callable[[Floats], Floats] | None = None) -> Geometry:
    """The same surface with exactly ``triangles`` more triangles, by splitting the longest edges.

    An edge between two triangles gives one triangle more to each, so ``triangles`` is even. Edges on a crease or seam
    stay whole, which keeps a closed surface closed. ``project`` moves the new vertices, (N, 3) to (N, 3), onto a curved
    surface.

    Raises:
        ValueError: ``triangles`` is odd or negative, or every edge is a crease or seam.
    """
    if triangles < 0 or triangles % 2:
        raise ValueError(f"triangles: {triangles} is not an even number of triangles to add")
    while triangles:
        batch = min(triangles // 2, max(1, part.triangle_count // 8))
        grown = _split_longest(part, batch, project)
        if grown.triangle_count == part.triangle_count:
            raise ValueError("part: no edge between two triangles can be split")
        triangles -= grown.triangle_count - part.triangle_count
        part = grown
    return part


def _split_longest(part: Geometry, count: int, project: Callable[[Floats], Floats] | None) -> Geometry:
    tri = part.indices.astype(np.int64)
    vertices = len(part.positions)
    start, end = tri.ravel(), np.roll(tri, -1, axis=1).ravel()
    order = np.argsort(np.minimum(start, end) * vertices + np.maximum(start, end), kind="stable")
    key = (np.minimum(start, end) * vertices + np.maximum(start, end))[order]
    first, uses = np.unique(key, return_index=True, return_counts=True)[1:]
    pair = first[uses == 2]
    left, right = order[pair], order[pair + 1]
    length = np.linalg.norm(part.positions[start[left]] - part.positions[end[left]], axis=1)
    used: set[int] = set()
    chosen: list[tuple[int, int]] = []
    for i in np.argsort(-length, kind="stable"):
        faces = {int(left[i]) // 3, int(right[i]) // 3}
        if len(faces) == 2 and not faces & used:
            used |= faces
            chosen.append((int(left[i]), int(right[i])))
            if len(chosen) == count:
                break
    if not chosen:
        return part
    positions, normals, uvs = list(part.positions), list(part.normals), list(part.uvs)
    faces_out = tri.copy()
    extra = []
    middles = np.array([(part.positions[start[a]] + part.positions[end[a]]) / 2 for a, _ in chosen])
    if project is not None:
        middles = project(middles)
    for (a, b), middle in zip(chosen, middles, strict=True):
        new = len(positions)
        positions.append(middle.astype(np.float32))
        normals.append(_unit(part.normals[start[a]] + part.normals[end[a]]))
        uvs.append((part.uvs[start[a]] + part.uvs[end[a]]) / 2)
        for half in (a, b):
            face, corner = divmod(half, 3)
            split = tri[face].copy()
            split[corner] = new
            faces_out[face, (corner + 1) % 3] = new
            extra.append(split)
    return Geometry(
        np.array(positions, np.float32),
        np.array(normals, np.float32),
        np.array(uvs, np.float32),
        np.concatenate([faces_out, np.array(extra)]).astype(np.uint32),
    )


# --- surfaces -----------------------------------------------------------------------------------------------------


def sheet(points: Floats, wrap: bool = False, uv_size: tuple[float, float] = (1.0, 1.0)) -> Geometry:
    """A smooth surface through a (rows, columns, 3) grid; the normal is ∂column × ∂row.

    Args:
        points: the grid. A row whose points all coincide is a pole: its quadrilaterals become single triangles.
        wrap: the columns close to a ring.
        uv_size: texture coordinates at the last column and row.
    """
    points = np.asarray(points, np.float64)
    if wrap:
        points = np.concatenate([points, points[:, :1]], axis=1)
    rows, columns = points.shape[:2]
    corner = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    pole = (points == points[:, :1]).all(axis=(1, 2))
    lower = np.stack([a, b, c], -1)[~pole[:-1]].reshape(-1, 3)
    upper = np.stack([a, c, d], -1)[~pole[1:]].reshape(-1, 3)
    indices = np.concatenate([lower, upper])
    position = points.reshape(-1, 3).astype(np.float32)
    welded = corner.copy()
    if wrap:
        welded[:, -1] = welded[:, 0]
    welded[pole] = welded[pole][:, :1]
    normals = vertex_normals(position, welded.ravel()[indices].astype(np.uint32))[welded.ravel()]
    u, v = np.meshgrid(np.linspace(0, uv_size[0], columns), np.linspace(0, uv_size[1], rows))
    uvs = np.stack([u, v], -1).reshape(-1, 2).astype(np.float32)
    return Geometry(position, normals, uvs, indices)


def plate(points: Floats, thickness: float, uv_size: tuple[float, float] = (1.0, 1.0)) -> Geometry:
    """A closed shell of even ``thickness`` about a (rows, columns, 3) grid: bent plywood, a roof tile, a blade."""
    points = np.asarray(points, np.float64)
    middle = sheet(points, uv_size=uv_size)
    offset = middle.normals.reshape(points.shape) * (thickness / 2)
    upper, lower = points + offset, points - offset

    def border(grid: Floats) -> Floats:
        return np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])

    front = sheet(upper, uv_size=uv_size)
    back = sheet(lower[:, ::-1], uv_size=uv_size)
    rim = sheet(np.stack([border(lower), border(upper)]), wrap=True, uv_size=(sum(uv_size), thickness))
    return merge([front, back, rim])


def flat(points: ArrayLike, normal: ArrayLike, uvs: ArrayLike | None = None) -> Geometry:
    """A convex planar polygon (N, 3), counter-clockwise about ``normal``, as a fan; uv by projection along an axis."""
    position = np.asarray(points, np.float32)
    direction = np.asarray(normal, np.float64)
    if uvs is None:
        axis = int(np.argmax(np.abs(direction)))
        uvs = position[:, [i for i in range(3) if i != axis]]
    fan = np.arange(1, len(position) - 1, dtype=np.uint32)
    return Geometry(
        position,
        np.broadcast_to(_unit(direction), position.shape).copy(),
        np.asarray(uvs, np.float32),
        np.stack([np.zeros_like(fan), fan, fan + 1], 1),
    )


def cuboid(low: ArrayLike, high: ArrayLike) -> Geometry:
    """An axis-aligned box with sharp edges, 12 triangles."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    faces = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for side in (low, high):
            corners = np.tile(side, (4, 1))
            ring = ((0, 0), (1, 0), (1, 1), (0, 1)) if side is high else ((0, 0), (0, 1), (1, 1), (1, 0))
            for corner, (i, j) in zip(corners, ring, strict=True):
                corner[first], corner[second] = (low, high)[i][first], (low, high)[j][second]
            normal = np.zeros(3)
            normal[axis] = 1 if side is high else -1
            faces.append(flat(corners, normal))
    return merge(faces)


def rounded_box(low: ArrayLike, high: ArrayLike, bevel: float, steps: int = 1) -> Geometry:
    """An axis-aligned box whose edges are rounded with radius ``bevel``; 12 (2·steps + 1)² triangles."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    centre, inner = (low + high) / 2, (high - low) / 2 - bevel
    tangents = np.tan(np.linspace(0, math.pi / 4, steps + 1))
    tangents[-1] = 1  # exact, so that neighbouring faces meet in bit-equal points
    offsets = np.concatenate([-tangents[::-1], tangents])
    signs = np.repeat([-1.0, 1.0], steps + 1)
    faces = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for side in (-1.0, 1.0):
            normal = np.zeros((2 * steps + 2, 2 * steps + 2, 3))
            anchor = np.zeros_like(normal)
            normal[..., axis] = side
            anchor[..., axis] = side * inner[axis]
            across, along = (first, second) if side > 0 else (second, first)
            normal[..., across], normal[..., along] = offsets[None, :], offsets[:, None]
            anchor[..., across], anchor[..., along] = signs[None, :] * inner[across], signs[:, None] * inner[along]
            direction = normal / np.sqrt((normal**2).sum(-1, keepdims=True))
            points = centre + anchor + bevel * direction
            face = sheet(points)
            uvs = points[..., [first, second]].reshape(-1, 2)
            faces.append(
                Geometry(face.positions, _unit(direction.reshape(-1, 3)), uvs.astype(np.float32), face.indices)
            )
    return merge(faces)


def _creases(line: Floats, angle: float) -> list[int]:
    """Indices of a polyline's ends and of its corners sharper than ``angle``."""
    step = np.diff(line, axis=0)
    step = step / np.linalg.norm(step, axis=1, keepdims=True)
    turn = np.einsum("ij,ij->i", step[:-1], step[1:])
    return [0, *(np.flatnonzero(turn < math.cos(angle)) + 1).tolist(), len(line) - 1]


def _travelled(line: Floats) -> Floats:
    """Arc length at each point of a polyline."""
    return np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def lathe(profile: ArrayLike, segments: int, crease: float = math.radians(35)) -> Geometry:
    """A surface of revolution about +Y.

    Args:
        profile: (N, 2) radius and height, with the outside to the right of the way from point to point upwards; it is
            closed if both ends have radius 0.
        segments: sides of the revolved ring.
        crease: a corner of the profile sharper than this angle, in radians, is an edge; others are smooth.
    """
    line = np.asarray(profile, np.float64)
    angle = np.arange(segments) * (2 * math.pi / segments)
    ring = np.stack([np.cos(angle), -np.sin(angle)], -1)
    points = np.empty((len(line), segments, 3))
    points[..., 0] = line[:, :1] * ring[:, 0]
    points[..., 1] = line[:, 1:]
    points[..., 2] = line[:, :1] * ring[:, 1]
    height = _travelled(line)
    around = 2 * math.pi * float(line[:, 0].max())
    return merge(
        sheet(points[a : b + 1], wrap=True, uv_size=(around, height[b] - height[a])).retextured((0, height[a]))
        for a, b in pairwise(_creases(line, crease))
    )


def ball(radius: float, segments: int, rings: int) -> Geometry:
    """A sphere of ``2 · segments · (rings − 1)`` triangles about the origin."""
    angle = np.linspace(-math.pi / 2, math.pi / 2, rings + 1)
    profile = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
    profile[[0, -1], 0] = 0
    return lathe(profile, segments, crease=math.pi)


def tube(path: ArrayLike, radius: ArrayLike, segments: int, closed: bool = False) -> Geometry:
    """A round tube along a polyline (N, 3), capped at its ends unless ``closed`` makes a ring of it.

    ``radius`` is one number or one for each point. The rings are carried along by rotation-minimising frames.
    """
    line = np.asarray(path, np.float64)
    if closed:
        tangent = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    else:
        tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent[0], (0.0, 1.0, 0.0) if abs(tangent[0, 1]) < 0.9 else (1.0, 0.0, 0.0))
    sides = np.empty_like(line)
    for i, t in enumerate(tangent):
        side = side - t * (side @ t)
        side /= np.linalg.norm(side)
        sides[i] = side
    other = np.cross(tangent, sides)
    angle = np.arange(segments) * (2 * math.pi / segments)
    ring = sides[:, None] * np.cos(angle)[:, None] + other[:, None] * np.sin(angle)[:, None]
    radii = np.broadcast_to(np.asarray(radius, np.float64), len(line))
    points = line[:, None] + radii[:, None, None] * ring
    around = 2 * math.pi * float(radii.max())
    along = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    if closed:
        points = np.concatenate([points, points[:1]])
        return sheet(points, wrap=True, uv_size=(around, along))
    first = np.stack([np.broadcast_to(line[0], points[0].shape), points[0]])
    last = np.stack([points[-1], np.broadcast_to(line[-1], points[-1].shape)])
    body = sheet(points, wrap=True, uv_size=(around, along))
    return merge([sheet(first, wrap=True), body, sheet(last, wrap=True)])


def smooth_path(points: ArrayLike, steps: int) -> Floats:
    """A Catmull–Rom curve through (N, 3) points, ``steps`` samples between neighbours."""
    p = np.asarray(points, np.float64)
    p = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])
    t = np.arange(steps)[:, None] / steps
    pieces = [
        0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
        for a, b, c, d in zip(p[:-3], p[1:-2], p[2:-1], p[3:], strict=True)
    ]
    return np.concatenate([*pieces, p[-2:-1]])


def ribbon_solid(outline: Floats, depth: float, crease: float = math.radians(35)) -> Geometry:
    """A closed band: a (N, 2, 2) strip of lower and upper points in XY, extruded in z from 0 to ``depth``.

    The upper points lie to the left of the strip's way; arches, lintels and book covers are such bands. Corners of its
    two sides sharper than ``crease`` are edges.
    """
    strip = np.asarray(outline, np.float64)
    near = np.concatenate([strip, np.full((*strip.shape[:2], 1), depth)], -1)
    far = np.concatenate([strip, np.zeros((*strip.shape[:2], 1))], -1)

    def planar(rows: list[Floats], normal: tuple[float, float, float]) -> Geometry:
        part = sheet(np.stack(rows))
        uvs = part.positions[:, :2]
        return Geometry(
            part.positions, np.tile(np.asarray(normal, np.float32), (len(uvs), 1)), uvs.copy(), part.indices
        )

    def swept(side: int, first: Floats, last: Floats) -> list[Geometry]:
        along = _travelled(strip[:, side])
        return [
            sheet(np.stack([first[a : b + 1], last[a : b + 1]]), uv_size=(along[b] - along[a], depth)).retextured(
                (along[a], 0)
            )
            for a, b in pairwise(_creases(strip[:, side], crease))
        ]

    ends = []
    for k, outward in ((0, 1), (-1, -1)):
        across = strip[k, 1] - strip[k, 0]
        quad = [far[k, 0], near[k, 0], near[k, 1], far[k, 1]][::outward]
        ends.append(flat(quad, (-across[1] * outward, across[0] * outward, 0)))
    return merge(
        [
            planar([near[:, 0], near[:, 1]], (0, 0, 1)),
            planar([far[:, 1], far[:, 0]], (0, 0, -1)),
            *swept(1, near[:, 1], far[:, 1]),
            *swept(0, far[:, 0], near[:, 0]),
            *ends,
        ]
    )


def pierced_wall(
    size: tuple[float, float], depth: float, holes: Sequence[tuple[float, float, float, float]]
) -> Geometry:
    """A closed wall in XY from the origin to ``size``, extruded from z = 0 to ``depth``, with rectangular holes.

    ``holes`` are (left, bottom, right, top) inside the wall; they may touch its border (a door) but not each other.
    """
    xs = np.unique([0.0, size[0], *(h[0] for h in holes), *(h[2] for h in holes)])
    ys = np.unique([0.0, size[1], *(h[1] for h in holes), *(h[3] for h in holes)])
    cx, cy = (xs[:-1] + xs[1:]) / 2, (ys[:-1] + ys[1:]) / 2
    solid = np.ones((len(cx) + 2, len(cy) + 2), bool)
    solid[[0, -1]] = solid[:, [0, -1]] = False
    for left, bottom, right, top in holes:
        inside = ((cx > left) & (cx < right))[:, None] & ((cy > bottom) & (cy < top))
        solid[1:-1, 1:-1] &= ~inside
    parts = []
    for i, j in np.argwhere(solid[1:-1, 1:-1]):
        x0, x1, y0, y1 = xs[i], xs[i + 1], ys[j], ys[j + 1]
        parts.append(flat([(x0, y0, depth), (x1, y0, depth), (x1, y1, depth), (x0, y1, depth)], (0, 0, 1)))
        parts.append(flat([(x0, y0, 0), (x0, y1, 0), (x1, y1, 0), (x1, y0, 0)], (0, 0, -1)))
        if not solid[i, j + 1]:
            parts.append(flat([(x0, y0, 0), (x0, y0, depth), (x0, y1, depth), (x0, y1, 0)], (-1, 0, 0)))
        if not solid[i + 2, j + 1]:
            parts.append(flat([(x1, y0, depth), (x1, y0, 0), (x1, y1, 0), (x1, y1, depth)], (1, 0, 0)))
        if not solid[i + 1, j]:
            parts.append(flat([(x0, y0, 0), (x1, y0, 0), (x1, y0, depth), (x0, y0, depth)], (0, -1, 0)))
        if not solid[i + 1, j + 2]:
            parts.append(flat([(x0, y1, depth), (x1, y1, depth), (x1, y1, 0), (x0, y1, 0)], (0, 1, 0)))
    return merge(parts)


def slab_with_oculus(
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    centre: tuple[float, float],
    radius: float,
    segments: int,
) -> Geometry:
    """A horizontal slab, a closed box, with a round hole of ``radius`` about (x, z) ``centre``."""
    cx, cz = centre
    corners = [math.atan2(cz - z, x - cx) % (2 * math.pi) for x in (low[0], high[0]) for z in (low[2], high[2])]
    angle = np.unique(np.concatenate([np.arange(segments) * (2 * math.pi / segments), corners]))
    direction = np.stack([np.cos(angle), -np.sin(angle)], 1)
    with np.errstate(divide="ignore"):
        reach_x = np.where(direction[:, 0] > 0, high[0] - cx, cx - low[0]) / np.abs(direction[:, 0])
        reach_z = np.where(direction[:, 1] > 0, high[2] - cz, cz - low[2]) / np.abs(direction[:, 1])
    inner = np.array(centre) + radius * direction
    outer = np.clip(
        np.array(centre) + np.minimum(reach_x, reach_z)[:, None] * direction, (low[0], low[2]), (high[0], high[2])
    )

    def ring(outline: Floats, y: float) -> Floats:
        return np.stack([outline[:, 0], np.full(len(outline), y), outline[:, 1]], 1)

    rings = [ring(inner, high[1]), ring(inner, low[1]), ring(outer, low[1]), ring(outer, high[1])]
    bore = sheet(np.stack([rings[0], rings[1]]), wrap=True, uv_size=(2 * math.pi * radius, high[1] - low[1]))
    parts = [bore]
    for a, b, y in ((1, 2, -1.0), (3, 0, 1.0)):
        part = sheet(np.stack([rings[a], rings[b]]), wrap=True)
        normals = np.tile(np.array((0, y, 0), np.float32), (len(part.positions), 1))
        parts.append(Geometry(part.positions, normals, part.positions[:, [0, 2]].copy(), part.indices))
    outward = np.concatenate([outer, outer[:1]])
    for k in range(len(angle)):
        (x0, z0), (x1, z1) = outward[k], outward[k + 1]
        normal = (z0 - z1, 0.0, x1 - x0)
        if math.hypot(*normal) > 0:
            quad = [(x0, low[1], z0), (x1, low[1], z1), (x1, high[1], z1), (x0, high[1], z0)]
            parts.append(flat(quad, normal))
    return merge(parts)


# --- seamless solids ----------------------------------------------------------------------------------------------


def ring(points: Floats) -> Geometry:
    """A smooth closed surface through a (rows, columns, 3) grid that wraps both ways, as a torus; no vertex is twice.

    The normal is ∂column × ∂row, 2·rows·columns triangles. Without a seam there are no texture coordinates: uv is 0.
    """
    rows, columns = points.shape[:2]
    a = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    return _smooth(points.reshape(-1, 3), _quads(np.concatenate([a, a[:1]])))


def spindle(points: Floats, first: ArrayLike, last: ArrayLike) -> Geometry:
    """A smooth closed surface through a (rows, columns, 3) grid of rings and a pole at each end; no vertex is twice.

    As :func:`ring`, with 2·rows·columns triangles: a ball, a bar along a curve, or, of one row, a double pyramid.
    """
    rows, columns = points.shape[:2]
    a = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    low, high = np.full(columns, rows * columns, np.uint32), np.full(columns, rows * columns + 1, np.uint32)
    bottom = np.stack([low, np.roll(a[0], -1), a[0]], 1)
    top = np.stack([high, a[-1], np.roll(a[-1], -1)], 1)
    poles = np.stack([np.asarray(first, np.float64), np.asarray(last, np.float64)])
    return _smooth(np.concatenate([points.reshape(-1, 3), poles]), np.concatenate([bottom, _quads(a), top]))


def _quads(corner: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """(T, 3) triangles between the rows of (rows, columns) vertex numbers, whose columns wrap."""
    a, d = corner[:-1], corner[1:]
    b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def _smooth(points: Floats, indices: NDArray[np.uint32]) -> Geometry:
    positions = points.astype(np.float32)
    return Geometry(positions, vertex_normals(positions, indices), np.zeros((len(positions), 2), np.float32), indices)


def faceted(part: Geometry) -> Geometry:
    """The same triangles with vertices of their own and their plane's normals."""
    corners = part.positions[part.indices]
    normals = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    count = len(part.indices)
    return Geometry(
        corners.reshape(-1, 3),
        np.repeat(normals, 3, axis=0),
        part.uvs[part.indices].reshape(-1, 2),
        np.arange(3 * count, dtype=np.uint32).reshape(-1, 3),
    )


def torus_knot(turns: tuple[int, int], radii: tuple[float, float, float], rows: int, columns: int) -> Geometry:
    """A round tube along a knot on a torus about +Z.

    Args:
        turns: p about the axis and q through the hole; without a common divisor. (2, 3) is the trefoil.
        radii: of the torus' middle circle, of its tube, and of the knot's own tube.
        rows, columns: along and around the tube.
    """
    p, q = turns
    large, small, thick = radii
    t = np.arange(rows) * (2 * math.pi / rows)

    def curve(t: Floats) -> Floats:
        distance = large + small * np.cos(q * t)
        return np.stack([distance * np.cos(p * t), distance * np.sin(p * t), -small * np.sin(q * t)], -1)

    # The torus' own normal closes after one round, as a frame carried along the curve does not.
    centre = np.stack([large * np.cos(p * t), large * np.sin(p * t), 0 * t], -1)
    line = curve(t)
    tangent = curve(t + 1e-4) - curve(t - 1e-4)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = line - centre
    side -= tangent * np.einsum("ij,ij->i", side, tangent)[:, None]
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.arange(columns) * (2 * math.pi / columns)
    around = side[:, None] * np.cos(angle)[:, None] + np.cross(tangent, side)[:, None] * np.sin(angle)[:, None]
    return ring(line[:, None] + thick * around)


# --- implicit surfaces --------------------------------------------------------------------------------------------

Field = Callable[[Floats], Floats]
"""Signed value of points (..., 3), metres, negative inside; (...)."""


def surface_nets(field: Field, low: ArrayLike, high: ArrayLike, cell: float) -> Geometry:
    """The zero set of ``field`` as a closed mesh with normals from the field's gradient.

    The surface must lie strictly inside the box from ``low`` to ``high``; ``cell`` is the grid spacing in metres.
    Texture coordinates are (angle about +Y / 2π, height).
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    counts = np.ceil((high - low) / cell).astype(int) + 1
    grid = low + cell * np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), -1)
    value = field(grid)
    total = np.zeros((*(counts - 1), 3))
    crossings = np.zeros(tuple(counts - 1), int)
    edges = []
    for axis in range(3):
        near, far = (_cut(value, axis, end) for end in (0, 1))
        crossed = (near < 0) != (far < 0)
        edges.append((crossed, near < 0))
        fraction = np.where(crossed, near / np.where(crossed, near - far, 1), 0)
        point = _cut(grid, axis, 0).copy()
        point[..., axis] += fraction * cell
        point *= crossed[..., None]
        others = [a for a in range(3) if a != axis]
        for i in (0, 1):
            for j in (0, 1):
                total += _cut(_cut(point, others[0], i), others[1], j)
                crossings += _cut(_cut(crossed, others[0], i), others[1], j)
    active = crossings > 0
    number = np.full(active.shape, -1)
    number[active] = np.arange(active.sum())
    positions = project_onto(field, total[active] / crossings[active][:, None])
    quads = []
    for axis, (crossed, begins_inside) in enumerate(edges):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        where = np.argwhere(crossed)
        where = where[(where[:, first] > 0) & (where[:, second] > 0)]
        corners = np.stack([where] * 4, 1)
        corners[:, [0, 3], first] -= 1
        corners[:, [0, 1], second] -= 1
        quad = number[corners[..., 0], corners[..., 1], corners[..., 2]]
        flip = ~begins_inside[where[:, 0], where[:, 1], where[:, 2]]
        quad[flip] = quad[flip][:, ::-1]
        quads.append(quad)
    quad = np.concatenate(quads)
    # Cut each quadrilateral along its shorter diagonal: fewer slivers, smoother silhouettes.
    p = positions[quad]
    turn = np.linalg.norm(p[:, 0] - p[:, 2], axis=1) > np.linalg.norm(p[:, 1] - p[:, 3], axis=1)
    quad[turn] = np.roll(quad[turn], 1, axis=1)
    indices = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]).astype(np.uint32)
    used = np.unique(indices)
    renumber = np.zeros(len(positions), np.uint32)
    renumber[used] = np.arange(len(used), dtype=np.uint32)
    positions = positions[used]
    angle = np.arctan2(positions[:, 0], positions[:, 2]) / (2 * math.pi)
    uvs = np.stack([angle, positions[:, 1]], 1).astype(np.float32)
    return Geometry(positions.astype(np.float32), _unit(gradient(field, positions)), uvs, renumber[indices])


def _cut(array: NDArray[Any], axis: int, end: int) -> NDArray[Any]:
    """Drop the last (end 0) or first (end 1) layer of an axis."""
    index: list[slice] = [slice(None)] * array.ndim
    index[axis] = slice(0, -1) if end == 0 else slice(1, None)
    return array[tuple(index)]


def gradient(field: Field, points: Floats, step: float = 1e-4) -> Floats:
    """∇field at (N, 3) points by central differences of ``step`` metres."""
    offsets = step * np.eye(3)
    return np.stack([field(points + o) - field(points - o) for o in offsets], -1) / (2 * step)


def project_onto(field: Field, points: Floats, steps: int = 2) -> Floats:
    """Points moved to the zero set by Newton steps along the gradient, 2 cm at most lest one leaves its feature."""
    for _ in range(steps):
        slope = gradient(field, points)
        move = (field(points) / np.maximum((slope**2).sum(-1), 1e-6))[..., None] * slope
        length = np.sqrt((move**2).sum(-1, keepdims=True))
        points = points - move * np.minimum(1, 0.02 / np.maximum(length, 1e-12))
    return points


def ellipsoid(p: Floats, centre: ArrayLike, radii: ArrayLike) -> Floats:
    """First-order distance of an ellipsoid: k(k − 1)/|∇k²/2| with k = |(p − c)/r| (Quilez's bound)."""
    r = np.asarray(radii, np.float64)
    q = (p - np.asarray(centre, np.float64)) / r
    k0 = np.sqrt((q**2).sum(-1))
    k1 = np.sqrt(((q / r) ** 2).sum(-1))
    return np.asarray(k0 * (k0 - 1) / np.maximum(k1, 1e-9))


def limb(p: Floats, a: ArrayLike, b: ArrayLike, radius_a: float, radius_b: float) -> Floats:
    """Distance to a capsule whose radius changes linearly from a to b."""
    start, axis = np.asarray(a, np.float64), np.subtract(b, a)
    h = np.clip(((p - start) @ axis) / (axis @ axis), 0, 1)
    return np.asarray(np.linalg.norm(p - start - h[..., None] * axis, axis=-1) - (radius_a + h * (radius_b - radius_a)))


def smooth_union(d1: Floats, d2: Floats, k: float) -> Floats:
    """Union with a fillet of about ``k`` metres: mix(d2, d1, h) − k h (1 − h), h = clamp(½ + ½(d2 − d1)/k)."""
    h = np.clip(0.5 + 0.5 * (d2 - d1) / k, 0, 1)
    return np.asarray(d2 + (d1 - d2) * h - k * h * (1 - h))
